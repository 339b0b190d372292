#include "xraycast/scan/convert.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/series/ct_series.hpp"

namespace xraycast {

void check(const ConvertRequest& request) {
  check(request.motion);
  if (std::error_code error; std::filesystem::equivalent(request.input, request.output, error))
    throw InputError("{}: is also the input and would be overwritten; choose another name",
                     request.output.string());
  if (is_ct_series(request.output)) return check(request.patient);
  if (request.patient.is_given())
    throw InputError("`patient` does not apply to {}, which is not DICOM; leave it out or name a folder",
                     request.output.string());
  check_volume_format(request.output);
  check_writable(request.output);
}

Converted convert(const ConvertRequest& request, Progress& progress) {
  check(request);
  const MotionOfRequest motion = held_motion(request.motion);
  const std::string name = request.input.string();
  Scan scan = moved(open_scan(name, request.scan, progress), motion, progress);
  Converted converted{
      .geometry = scan.source->geometry(), .info = scan.info, .is_series = is_ct_series(request.output)};
  if (converted.is_series) check_ct_series(converted.geometry, request.output, request.patient);

  const Volume volume = collect(*scan.source, progress, name);
  converted.voxel_warnings = scan.source->hu_range().warnings();
  converted.frame_of_reference_uid =
      frame_of_reference_for(request.patient, frame_of_reference_uid(scan.info));
  converted.motion = motion;
  if (converted.is_series)
    write_ct_series(volume, request.output, request.patient,
                    {name + motion.suffix(), converted.frame_of_reference_uid}, progress);
  else
    write_volume(volume, request.output, progress);
  return converted;
}

}  // namespace xraycast
