// Adds the optical depths of the body and of absorbing surfaces, and applies the grey window.
uniform highp sampler2D body, absorbed, shade, near_tau;  // `body`: four rows per texel
uniform mat3 from_pixel;
uniform float view_height;
uniform vec2 body_size;   // columns and rows; 0 without a body
uniform float last_quad;
uniform vec2 row_limits;  // the first and last row of the body
uniform bool is_resampled, has_absorbed, has_shade, gives_tau, inverted;
uniform float weight;     // of what surfaces absorb
uniform bool has_outline;  // of what the green of `absorbed` covers
uniform vec3 outline_colour;
uniform float scale, contrast, black, gamma;
out vec4 result;

float body_column(float column, float row) {
  float quad = floor(0.25 * row), from_quad = row - 4.0 * quad;
  vec4 upper = texelFetch(body, ivec2(column, quad), 0);
  vec4 lower = texelFetch(body, ivec2(column, min(quad + 1.0, last_quad)), 0);
  vec4 places = vec4(0.0, 1.0, 2.0, 3.0);
  return dot(upper, max(1.0 - abs(from_quad - places), 0.0)) + lower.x * max(from_quad - 3.0, 0.0);
}

float body_tau(vec2 place) {
  vec2 last = body_size - 1.0, within = clamp(place, vec2(0.0), last);
  bool outside = last.x < 0.0 || place.y < row_limits.x || place.y > row_limits.y || place.x < -0.5 || place.x > last.x + 0.5;
  if (outside) return 0.0;
  if (!is_resampled) return max(body_column(floor(within.x + 0.5), within.y), 0.0);
  float left = floor(within.x);
  return max(mix(body_column(left, within.y), body_column(min(left + 1.0, last.x), within.y), within.x - left), 0.0);
}

bool covers(ivec2 at) {
  ivec2 size = textureSize(absorbed, 0);
  const float kTouched_mm = 0.01;  // above the rounding of depths
  return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size)) && texelFetch(absorbed, at, 0).y > kTouched_mm;
}

bool is_on_outline(ivec2 at) {
  return covers(at) && !(covers(at - ivec2(1, 0)) && covers(at + ivec2(1, 0)) && covers(at - ivec2(0, 1)) && covers(at + ivec2(0, 1)));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  if (has_outline && is_on_outline(at)) {
    result = vec4(outline_colour, 1.0);
    return;
  }
  if (has_shade && texelFetch(shade, at, 0).a > 0.0) {
    float tau = max(texelFetch(near_tau, at, 0).x, 0.0);
    vec3 matter = vec3(inverted ? 1.0 : 0.0);
    result = gives_tau ? vec4(tau) : vec4(mix(matter, texelFetch(shade, at, 0).rgb, exp(-tau / scale)), 1.0);
    return;
  }
  vec3 place = from_pixel * vec3(gl_FragCoord.x, view_height - gl_FragCoord.y, 1.0);
  float tau = body_tau(place.xy / place.z);
  if (has_absorbed) tau += weight * max(texelFetch(absorbed, at, 0).x, 0.0);
  if (gives_tau) {
    result = vec4(tau);
    return;
  }
  float grey = clamp(exp(-tau / scale) * contrast - black, 0.0, 1.0);
  if (gamma != 1.0) grey = pow(grey, 1.0 / gamma);
  result = vec4(vec3(inverted ? 1.0 - grey : grey), 1.0);
}
