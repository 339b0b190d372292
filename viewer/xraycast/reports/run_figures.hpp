#pragma once

#include <array>

namespace xraycast {

/// A figure: its name in files, in words, its unit, and the decimals that are shown.
struct Figure {
  const char* name;
  const char* words;
  const char* unit;
  int decimals;
};

inline constexpr std::array<Figure, 8> kOfRun{{{"time_s", "time", "s", 1},
                                               {"idle_s", "idle", "s", 1},
                                               {"fluoroscopy_s", "fluoroscopy", "s", 1},
                                               {"exposures", "exposures", "", 0},
                                               {"air_kerma_mGy", "air kerma", "mGy", 2},
                                               {"dap_Gycm2", "dose-area product", "Gy cm²", 3},
                                               {"injected_ml", "contrast agent", "ml", 1},
                                               {"cine_runs", "cine runs", "", 0}}};
inline constexpr std::array<Figure, 14> kOfInstrument{
    {{"tip_path_mm", "path of the tip", "mm", 0},
     {"idle_s", "idle", "s", 1},
     {"turned_deg", "turned", "°", 0},
     {"turn_backs", "changes of the turn", "", 0},
     {"reversals", "reversals", "", 0},
     {"largest_force_N", "largest force at the hub", "N", 2},
     {"mean_force_N", "mean force at the hub", "N", 2},
     {"largest_torque_mNm", "largest torque at the hub", "mN m", 2},
     {"mean_torque_mNm", "mean torque at the hub", "mN m", 2},
     {"largest_wall_force_N", "largest force on the wall", "N", 2},
     {"wall_impulse_Ns", "impulse on the wall above 0.1 N", "N s", 2},
     {"slips", "slips", "", 0},
     {"whips", "whips", "", 0},
     {"exchanges", "exchanges", "", 0}}};
inline constexpr std::array<Figure, 27> kOfTreatment{
    {{"from_s", "begun", "s", 1},
     {"to_s", "ended", "s", 1},
     {"from_mm", "from, along the vessel", "mm", 1},
     {"to_mm", "to, along the vessel", "mm", 1},
     {"largest_bar", "largest pressure", "bar", 1},
     {"opened_mm", "opened to", "mm", 2},
     {"occluded_s", "vessel filled by the balloon", "s", 1},
     {"reference_mm", "reference diameter", "mm", 2},
     {"balloon_to_vessel", "balloon to vessel", "", 2},
     {"least_before_mm", "least diameter before", "mm", 2},
     {"least_after_mm", "least diameter after", "mm", 2},
     {"stenosis_before_percent", "stenosis before", "%", 0},
     {"residual_stenosis_percent", "residual stenosis", "%", 0},
     {"off_narrowest_mm", "off the narrowest place", "mm", 1},
     {"oversizing", "stent to vessel", "", 2},
     {"outward_N_mm", "stent's force outwards", "N/mm", 2},
     {"sheathed_rings", "rings still in the sheath", "", 0},
     {"stent_mm", "stent's diameter", "mm", 2},
     {"stent_length_mm", "stent's length", "mm", 1},
     {"malapposition_mm", "struts off the wall, largest", "mm", 2},
     {"malapposed_percent", "length of struts off the wall", "%", 0},
     {"coil_mm", "coil in the sac", "mm", 0},
     {"sac_mm3", "volume of the sac", "mm³", 0},
     {"packing_percent", "packing density", "%", 1},
     {"inflow_percent", "the sac's inflow, of that without coils", "%", 0},
     {"particles", "particles", "", 0},
     {"periphery_percent", "conductance left of the periphery", "%", 0}}};
inline constexpr std::array<Figure, 6> kCurves{{{"insertion_mm", "insertion", "mm", 0},
                                                {"tip_path_mm", "path of the tip", "mm", 0},
                                                {"force_N", "force at the hub", "N", 0},
                                                {"torque_mNm", "torque at the hub", "mN m", 0},
                                                {"wall_force_N", "force on the wall", "N", 0},
                                                {"pressure_mmHg", "mean pressure at the tip", "mmHg", 0}}};

}  // namespace xraycast
