// The picture of a detector, in the middle of the canvas, and the outline of what the green of `covered` covers.
uniform highp sampler2D greys, covered;
uniform vec2 canvas_size, image_size;  // in pixels
uniform float image_pixels;            // of the image, in a pixel of the canvas
uniform bool has_outline, inverted;
uniform vec3 outline_colour;
uniform float contrast, black, gamma;
out vec4 result;

bool covers(ivec2 at) {
  ivec2 size = textureSize(covered, 0);
  const float kTouched_mm = 0.01;  // above the rounding of depths
  return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size)) && texelFetch(covered, at, 0).y > kTouched_mm;
}

bool is_on_outline(ivec2 at) {
  return covers(at) && !(covers(at - ivec2(1, 0)) && covers(at + ivec2(1, 0)) && covers(at - ivec2(0, 1)) && covers(at + ivec2(0, 1)));
}

float grey_at(ivec2 at) {
  return texelFetch(greys, clamp(at, ivec2(0), ivec2(image_size) - 1), 0).x;
}

void main() {
  vec2 place = (gl_FragCoord.xy - 0.5 * canvas_size) * image_pixels + 0.5 * image_size;
  if (has_outline && is_on_outline(ivec2(floor(place)))) {
    result = vec4(outline_colour, 1.0);
    return;
  }
  vec2 from_top = vec2(place.x, image_size.y - place.y) - 0.5, part = fract(from_top);
  ivec2 at = ivec2(floor(from_top));
  float grey = mix(mix(grey_at(at), grey_at(at + ivec2(1, 0)), part.x), mix(grey_at(at + ivec2(0, 1)), grey_at(at + 1), part.x), part.y);
  bool is_beyond = any(lessThan(place, vec2(0.0))) || any(greaterThan(place, image_size));
  grey = is_beyond ? 0.0 : clamp(grey * contrast - black, 0.0, 1.0);
  if (gamma != 1.0) grey = pow(grey, 1.0 / gamma);
  result = vec4(vec3(inverted ? 1.0 - grey : grey), 1.0);
}
