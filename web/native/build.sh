#!/bin/sh
# Compiles the simulation to WebAssembly by Debian's emscripten, and writes it deflated, in base64: `build.sh FILE [FOLDER]`, where
# FOLDER takes objects (default: build/wasm). The same sources as the program's, with the same arithmetic, four numbers at once as in the program: no products are fused.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
file=$1
folder=${2:-$root/build/wasm}
sources="
  host/xraycast/base/json_text host/xraycast/base/metal_depth host/xraycast/base/plain_text host/xraycast/base/pluralize host/xraycast/base/printable
  host/xraycast/geometry/branch_names host/xraycast/geometry/nurbs_curve host/xraycast/geometry/segment_index host/xraycast/geometry/tube host/xraycast/geometry/vessel_tree
  host/xraycast/motion/body_clock host/xraycast/motion/displacement host/xraycast/motion/motion host/xraycast/motion/motion_mode
  host/xraycast/projection/view
  simulation/xraycast/mechanics/balloon_model simulation/xraycast/mechanics/block_band_matrix simulation/xraycast/mechanics/coil_model simulation/xraycast/mechanics/instrument_model simulation/xraycast/mechanics/marker_model simulation/xraycast/mechanics/rod
  simulation/xraycast/mechanics/rod_derivatives simulation/xraycast/mechanics/rod_system simulation/xraycast/mechanics/stent_model
  simulation/xraycast/catheter/aneurysm_sac simulation/xraycast/catheter/hub simulation/xraycast/catheter/lumen_distance_field simulation/xraycast/catheter/lumen_profile
  simulation/xraycast/catheter/moving_body
  simulation/xraycast/catheter/vessel_entry simulation/xraycast/catheter/wall_contact simulation/xraycast/catheter/yielding_walls
  simulation/xraycast/coaxial/coaxial_rods simulation/xraycast/coaxial/coil_pack simulation/xraycast/coaxial/instruments simulation/xraycast/coaxial/lumen_contact
  simulation/xraycast/coaxial/placed_stent simulation/xraycast/coaxial/rod_curve simulation/xraycast/coaxial/self_expansion
  simulation/xraycast/coaxial/treatment
  simulation/xraycast/blood_flow/flow_network simulation/xraycast/blood_flow/heart_waveform simulation/xraycast/blood_flow/heartbeat simulation/xraycast/blood_flow/rest_flow
  simulation/xraycast/blood_flow/embolisation simulation/xraycast/blood_flow/sac_inflow simulation/xraycast/blood_flow/tree_flow simulation/xraycast/blood_flow/vessel_impedance
  simulation/xraycast/contrast_agent/agent_outlet simulation/xraycast/simulation/coiling
  simulation/xraycast/contrast_agent/contrast_bolus simulation/xraycast/simulation/instrument_pressures simulation/xraycast/contrast_agent/laminar_vessel
  simulation/xraycast/simulation/tip_pressures
  simulation/xraycast/simulation/exercise simulation/xraycast/simulation/exercise_progress
  simulation/xraycast/simulation/run_monitor simulation/xraycast/simulation/run_report
  simulation/xraycast/haptics/hub_couplings simulation/xraycast/haptics/virtual_coupling
  viewer/xraycast/fluoroscope/absorption_stage viewer/xraycast/fluoroscope/beam viewer/xraycast/fluoroscope/blur
  viewer/xraycast/fluoroscope/blur_stage viewer/xraycast/fluoroscope/c_arm viewer/xraycast/fluoroscope/collimation
  viewer/xraycast/fluoroscope/detected_spectrum viewer/xraycast/fluoroscope/detector_view
  viewer/xraycast/display/between_blades viewer/xraycast/display/cell_ramps viewer/xraycast/display/display_chain
  viewer/xraycast/display/display_loops
  viewer/xraycast/display/display_window viewer/xraycast/display/dynamic_range
  viewer/xraycast/display/edge_enhancement
  viewer/xraycast/display/starved_pixels viewer/xraycast/display/temporal_filter
  viewer/xraycast/fluoroscope/electronics_stage
  viewer/xraycast/fluoroscope/exposure viewer/xraycast/fluoroscope/exposure_control
  viewer/xraycast/fluoroscope/fluoroscope viewer/xraycast/fluoroscope/fluoroscopy_options
  viewer/xraycast/fluoroscope/lag_stage viewer/xraycast/fluoroscope/measuring_field
  viewer/xraycast/fluoroscope/pixel_loops viewer/xraycast/fluoroscope/quanta_stage viewer/xraycast/fluoroscope/scatter
  viewer/xraycast/fluoroscope/scatter_stage viewer/xraycast/fluoroscope/scintillator_blur
  viewer/xraycast/fluoroscope/subtraction viewer/xraycast/fluoroscope/water_path
  viewer/xraycast/fluoroscope/xray_generator
  viewer/xraycast/acquisition/acquisition viewer/xraycast/acquisition/console viewer/xraycast/acquisition/phase_masks
  viewer/xraycast/scene/contrast_surface viewer/xraycast/scene/device_tubes viewer/xraycast/scene/instrument_curve
  viewer/xraycast/trainer/browser_message viewer/xraycast/trainer/fluoroscope_setup viewer/xraycast/trainer/page_motion
  viewer/xraycast/trainer/trainer viewer/xraycast/trainer/trainer_body
  viewer/xraycast/trainer/trainer_setup
  web/native/calls web/native/fluoroscope web/native/parallel web/native/trainer web/native/tube_beam"
mkdir -p "$folder/include"
# Debian's header-only libraries, without its C library beside them.
for library in fmt glm nlohmann; do ln -sfn "/usr/include/$library" "$folder/include/$library"; done
flags="-std=c++20 -O2 -msimd128 -flto -DNDEBUG -DFMT_HEADER_ONLY -ffp-contract=off -fno-math-errno -fwasm-exceptions -Wno-psabi -include web/native/bit_cast.hpp"
cd "$root"
# A folder's sources are compiled together: most of the time is spent on headers.
rooms=$(for source in $sources; do dirname "$source"; done | sort -u)
units=
for room in $rooms; do
  unit=$folder/$(echo "$room" | tr / _)
  units="$units $unit"
  for source in $sources; do [ "$(dirname "$source")" != "$room" ] || echo "#include \"$root/$source.cpp\""; done >"$folder/sources"
  cmp -s "$folder/sources" "$unit.cpp" || cp "$folder/sources" "$unit.cpp"
done
printf '%s\n' $units | xargs -P "$(nproc)" -I{} sh -c '
  case $2 in *host_*|*_acquisition|*_blood_flow|*_scene|*_simulation|*_trainer) small=-Os ;; esac  # beside rods and pulses they take no time
  [ -f "$2.o" ] && [ -z "$(find host simulation viewer web/native "$2.cpp" -newer "$2.o" \( -name "*.[ch]pp" -o -name build.sh \) | head -1)" ] ||
    emcc $3 $small -Ihost -Isimulation -Iviewer -I"$1/include" -isystem /usr/include/eigen3 -c "$2.cpp" -o "$2.o"' sh "$folder" {} "$flags"
objects=$(printf '%s.o ' $units)
# shellcheck disable=SC2086
emcc $flags -Os $objects -o "$folder/simulation.wasm" --no-entry -sSTANDALONE_WASM=1 -sALLOW_MEMORY_GROWTH=1 -sFILESYSTEM=0 -sMALLOC=emmalloc
node -e '
const { readFileSync, writeFileSync } = require("node:fs"), { deflateSync } = require("node:zlib");
const code = readFileSync(process.argv[1]), packed = deflateSync(code, { level: 9 }).toString("base64");
writeFileSync(process.argv[2], packed);
console.error(`${code.length} bytes of WebAssembly, ${packed.length} in a page`);' "$folder/simulation.wasm" "$file"
