// Adds the optical depths of the body and of absorbing surfaces and applies the grey window. Variants: TAU (optical
// depth instead of grey), ABSORBING, RESAMPLED (columns are interpolated), GAMMA.
uniform sampler2D body;  // four rows per texel
uniform mat3 from_pixel;
uniform float view_height;
uniform vec2 origin;  // of the view within the framebuffer
uniform vec2 body_size;    // columns and rows
uniform float last_quad;
uniform vec2 row_limits;   // the first and last row of the body
#ifdef ABSORBING
uniform sampler2D absorbed;
uniform float weight;
#endif
#ifdef TAU
out float result;
#else
// GreyWindow: contrast = 1 / (light - dark), black = dark * contrast.
uniform float scale, contrast, black, gamma;
uniform bool inverted;
out vec4 result;
#endif

// A column, interpolated between its rows.
float body_column(float column, float row) {
  float quad = floor(0.25 * row), from_quad = row - 4.0 * quad;
  vec4 upper = texelFetch(body, ivec2(column, quad), 0);
  vec4 lower = texelFetch(body, ivec2(column, min(quad + 1.0, last_quad)), 0);
  vec4 places = vec4(0.0, 1.0, 2.0, 3.0);
  return dot(upper, max(1.0 - abs(from_quad - places), 0.0)) + lower.x * max(from_quad - 3.0, 0.0);
}

float body_tau(vec2 place) {
  vec2 last = body_size - 1.0;
  vec2 within = clamp(place, vec2(0.0), last);
#ifdef RESAMPLED
  float left = floor(within.x);
  float tau = mix(body_column(left, within.y), body_column(min(left + 1.0, last.x), within.y), within.x - left);
#else
  float tau = body_column(floor(within.x + 0.5), within.y);
#endif
  bool outside = place.y < row_limits.x || place.y > row_limits.y || place.x < -0.5 || place.x > last.x + 0.5;
  return outside ? 0.0 : max(tau, 0.0);
}

void main() {
  vec2 here = gl_FragCoord.xy - origin;
  vec3 place = from_pixel * vec3(here.x, view_height - here.y, 1.0);
  float tau = body_tau(place.xy / place.z);
#ifdef ABSORBING
  tau += weight * max(texelFetch(absorbed, ivec2(here), 0).x, 0.0);
#endif
#ifdef TAU
  result = tau;
#else
  float grey = clamp(exp(-tau / scale) * contrast - black, 0.0, 1.0);
#ifdef GAMMA
  grey = pow(grey, 1.0 / gamma);
#endif
  result = vec4(vec3(inverted ? 1.0 - grey : grey), 1.0);
#endif
}
