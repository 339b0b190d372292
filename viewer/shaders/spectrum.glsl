// What a beam of several energies loses in three materials (SpectrumModel).
uniform samplerBuffer spectrum_table;  // share of the energy, then mu/rho in cm2/g of each material
uniform int spectrum_bins;

float spectral_tau(vec3 g_cm2) {
  float passed = 0.0;
  for (int i = 0; i < spectrum_bins; ++i) {
    vec4 bin = texelFetch(spectrum_table, i);
    passed += bin.x * exp(-dot(bin.yzw, g_cm2));
  }
  return -log(max(passed, 1e-30));
}
