// A FlowNetwork over time, for flow_network_test.py: from JSON on the standard input to JSON on the standard
// output.
//
// {"nodes": [{"parent", "resistance", "inertance", "quadratic_loss", "is_pipe", "compliance", "is_held"},
// ...],
//  "step": s, "beats": n, "inflow": {node: [at the end of each step of a beat]}, "given": {node: [the same]}}
// -> {"pressure": [[of each node] at the end of each step of the last beat], "flow": the same}
#include "xraycast/blood_flow/flow_network.hpp"

#include <nlohmann/json.hpp>

#include <cstddef>
#include <iostream>
#include <string>
#include <vector>

int main() {
  using nlohmann::json;
  const json given = json::parse(std::cin);
  std::vector<xraycast::FlowNode> nodes;
  for (const json& node : given["nodes"])
    nodes.push_back({.parent = node.value("parent", -1),
                     .resistance = node.value("resistance", 0.0),
                     .inertance = node.value("inertance", 0.0),
                     .quadratic_loss = node.value("quadratic_loss", 0.0),
                     .is_pipe = node.value("is_pipe", false),
                     .compliance = node.value("compliance", 0.0),
                     .is_held = node.value("is_held", false)});
  xraycast::FlowNetwork network(nodes);
  std::size_t steps = 0;
  const auto give = [&](std::size_t step) {
    for (const auto& [node, values] : given["inflow"].items()) {
      network.ramp_inflow(std::stoul(node), values[step == 0 ? values.size() - 1 : step - 1], values[step]);
      steps = values.size();
    }
    for (const auto& [node, values] : given["given"].items()) {
      network.set_outside(std::stoul(node), values[step]);
      steps = values.size();
    }
  };
  give(0);
  network.settle();
  json pressures = json::array(), flows = json::array();
  const int beats = given["beats"];
  for (int beat = 0; beat < beats; ++beat)
    for (std::size_t step = 0; step < steps; ++step) {
      give(step);
      network.step(given["step"]);
      if (beat + 1 < beats) continue;
      json pressure = json::array(), flow = json::array();
      for (std::size_t i = 0; i < network.size(); ++i) {
        pressure.push_back(network.pressure(i));
        flow.push_back(network.flow(i));
      }
      pressures.push_back(pressure);
      flows.push_back(flow);
    }
  std::cout << json{{"pressure", pressures}, {"flow", flows}} << "\n";
}
