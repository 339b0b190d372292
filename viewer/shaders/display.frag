// The frame: the body's picture looked up, surfaces in front of or within it, and grey. Variants: TAU (optical
// depth instead of grey), SURFACE or ABSORBING (opaque or absorbing surfaces), SPECTRUM, BETWEEN_COLUMNS,
// GAMMA.
uniform sampler2D body;  // four rows a texel
uniform mat3 from_pixel;
uniform float view_height;
uniform vec2 origin;  // of the view within the framebuffer
uniform vec2 body_size;    // columns and rows
uniform float last_quad;
uniform vec2 row_limits;   // between which there is a body
#ifdef SURFACE
uniform sampler2D shade, near_tau;
#endif
#ifdef ABSORBING
uniform sampler2D absorbed;
#endif
#ifdef TAU
out float result;
#else
uniform float scale, contrast, black, gamma;  // of GreyWindow: contrast = 1 / (light - dark), black = dark * contrast
uniform bool inverted;
out vec4 result;
#endif
#if defined(SPECTRUM) && defined(SURFACE)
#include "spectrum.glsl"
#endif

// Between two of a column's rows.
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
#ifdef BETWEEN_COLUMNS
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
  ivec2 at = ivec2(here);
#ifdef ABSORBING
  tau += max(texelFetch(absorbed, at, 0).x, 0.0);
#endif
#ifdef SURFACE
  vec4 surface = texelFetch(shade, at, 0);
#ifdef SPECTRUM
  float in_front = spectral_tau(max(texelFetch(near_tau, at, 0).xyz, 0.0));
#else
  float in_front = max(texelFetch(near_tau, at, 0).x, 0.0);
#endif
  if (surface.a > 0.0) tau = in_front;
#endif
#ifdef TAU
  result = tau;
#else
  float grey = clamp(exp(-tau / scale) * contrast - black, 0.0, 1.0);
#ifdef GAMMA
  grey = pow(grey, 1.0 / gamma);
#endif
  float matter = inverted ? 1.0 : 0.0;
  vec3 shown = vec3(abs(matter - grey));
#ifdef SURFACE
  if (surface.a > 0.0) shown = mix(vec3(matter), surface.rgb, exp(-tau / scale));
#endif
  result = vec4(shown, 1.0);
#endif
}
