#include "vessels/scan_beside.hpp"

#include "xraycast/scan/scan.hpp"

namespace xraycast::cli {

ScanBeside read_scan_beside(const std::string& path, const ScanOptions& options, Invocation& invocation) {
  if (path.empty()) return {};
  const Scan scan = open_scan(path, options, invocation.progress);
  invocation.say_about(scan.info);
  return {collect(*scan.source, invocation.progress, path), scan.info};
}

}  // namespace xraycast::cli
