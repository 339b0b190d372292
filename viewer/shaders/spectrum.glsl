// Attenuation of a polychromatic beam by three materials (SpectrumModel).
uniform samplerBuffer spectrum_table;  // weight of the energy bin, then mu/rho in cm2/g of each material
uniform int spectrum_bins;

float spectral_tau(vec3 g_cm2) {
  float transmission = 0.0;
  for (int i = 0; i < spectrum_bins; ++i) {
    vec4 bin = texelFetch(spectrum_table, i);
    transmission += bin.x * exp(-dot(bin.yzw, g_cm2));
  }
  return -log(max(transmission, 1e-30));
}
