#include "smartsurf/view/gl/ShaderChunks.h"

namespace smartsurf::view {
namespace {

constexpr const char* kPinVertex = R"(
uniform usamplerBuffer pins;   // PinInstance records, three texels each
uniform vec4 pin;       // half top x, half top y, length, pitch
uniform float base;     // z of the ground
uniform float sunk;     // depth below the neighbour's top to which a side is drawn
flat out vec2 levels;   // z where the pin ends and its shaft begins; z of the top beside this side
#ifdef CLOSED
out vec2 across;        // offset from the face's middle, 1 at the pin's edge; the gap lies beyond 1
flat out vec2 gap;      // brightness of the gap across x and across y
flat out vec4 closed;   // 1 where the gap to the west, east, south, north is closed, else 0
#endif
uniform float sealed;   // 1: the sides of the outermost ring close the gaps beside them; 0: wide gaps
uniform float level;    // a gap beside a neighbour counts as closed if its top is at most this much lower
out float beyond;       // along a side of the outermost ring, 1 at the pin's edge; the gap lies beyond 1
#ifdef FAST
out vec4 shade;         // screen colour before the darkening towards the foot; w: z
#else
out vec3 world;
out vec2 place_on_top;  // from the pin's axis, in the pin's frame
flat out vec3 facing;   // the face's normal, in the pin's frame
flat out vec3 rotation; // of the pin: cosine and sine; z of its top
flat out vec3 albedo;
out float open_sky;
#endif
vec4 bytes(uint b) { return vec4(b & 255u, (b >> 8) & 255u, (b >> 16) & 255u, b >> 24) / 255.0; }
void main() {
  int record = (gl_VertexID >> 4) * 3, face = (gl_VertexID >> 2) & 3, k = gl_VertexID & 3;
  vec4 placed = uintBitsToFloat(texelFetch(pins, record)), neighbour = uintBitsToFloat(texelFetch(pins, record + 1));
  uvec4 rest = texelFetch(pins, record + 2);
  vec4 colour = bytes(rest.x), corner_sky = bytes(rest.y);
  vec2 place = placed.xy;
  float height = uintBitsToFloat(rest.z);
  // x, y: ±1; z: 0 foot, 1 top; w: 0 top face, 1 side across x, 2 side across y
  float u = k == 1 || k == 2 ? 1.0 : -1.0, v = k >= 2 ? 1.0 : -1.0;
  vec4 corner = face == 0 ? vec4(u, v, 1, 0) : face == 1 ? vec4(1, u, max(v, 0.0), 1) : vec4(u, 1, max(v, 0.0), 2);
  mat2 turn = mat2(placed.z, placed.w, -placed.w, placed.z);
  // Only the two sides that face the eye are drawn.
  vec2 towards = (eye.w > 0.5 ? eye.xy - place : -ray.xy) * turn;
  vec2 s = vec2(towards.x < 0.0 ? -1.0 : 1.0, towards.y < 0.0 ? -1.0 : 1.0);
  vec2 at = corner.xy * s;
  vec3 own = corner.w < 0.5 ? vec3(0, 0, 1) : corner.w < 1.5 ? vec3(s.x, 0, 0) : vec3(0, s.y, 0);
  float beside = corner.w < 1.5 ? (s.x < 0.0 ? neighbour.x : neighbour.y)
                                : (s.y < 0.0 ? neighbour.z : neighbour.w);
  float foot = colour.a > 0.5 ? base : max(base, min(beside, height) - sunk);
  vec2 half_top = pin.xy;
  // The background must not show through the gaps of the outermost ring: its sides extend to the middle of
  // the gaps beside level or higher pins.
  beyond = 0.0;
#ifndef CLOSED
  if (sealed > 0.5 && colour.a > 0.5 && corner.w > 0.5) {
    vec2 tallest = vec2(at.x < 0.0 ? neighbour.x : neighbour.y, at.y < 0.0 ? neighbour.z : neighbour.w);
    vec2 widened = half_top + (0.5 * pin.w - pin.xy) * step(height - level, tallest);
    if (corner.w < 1.5) {
      half_top.y = widened.y;
      beyond = at.y * half_top.y / pin.y;
    } else {
      half_top.x = widened.x;
      beyond = at.x * half_top.x / pin.x;
    }
  }
#else
  // Towards level or higher neighbours a face extends to the middle of the gap, which is painted on it.
  vec2 tall = vec2(at.x < 0.0 ? neighbour.x : neighbour.y, at.y < 0.0 ? neighbour.z : neighbour.w);
  half_top += (0.5 * pin.w - pin.xy) * step(height - level, tall);
  if (corner.w > 0.5 && corner.w < 1.5) half_top.x = pin.x;
  if (corner.w > 1.5) half_top.y = pin.y;
  across = at * half_top / pin.xy;
  closed = step(vec4(height - level), neighbour);
  if (corner.w > 0.5 && corner.w < 1.5) across.x = 0.0;
  if (corner.w > 1.5) across.y = 0.0;
  // The wall behind a gap is visible down to where the line of sight meets it.
  vec2 seen = (pin.w - 2.0 * pin.xy) * (eye.w > 0.5 ? eye.z - height : -ray.z) / max(abs(towards), 1e-3);
  gap = sqrt(0.55 / (1.0 + 1.5 * min(seen / pin.w, sunk)));
#endif
  vec3 p = vec3(place + turn * (at * half_top), corner.z > 0.5 ? height : min(foot, height));
  levels = vec2(height - pin.z, corner.w < 0.5 ? -1e30 : beside);
  float open = at.y < 0.0 ? (at.x < 0.0 ? corner_sky.x : corner_sky.y) : (at.x < 0.0 ? corner_sky.z : corner_sky.w);
#ifdef FAST
  shade = vec4(lit(colour.rgb, vec3(turn * own.xy, own.z), p, open), p.z);
#else
  world = p;
  place_on_top = at * half_top;
  facing = own;
  rotation = vec3(placed.zw, height);
  albedo = colour.rgb;
  open_sky = open;
#endif
  gl_Position = clip_from_world * vec4(p, 1.0);
}
)";

// Share of the sky light at a depth below the neighbour's top, in pitches.
constexpr const char* kGapOcclusion = R"(
float gap_sky(float below) {
  return below > 0.0 ? 0.55 / (1.0 + 3.0 * below) : clamp(0.55 - 0.35 * below, 0.55, 1.0);
}
)";

constexpr const char* kPinFragment = R"(
in vec3 world;
in vec2 place_on_top;
flat in vec3 facing;
flat in vec3 rotation;
flat in vec3 albedo;
flat in vec2 levels;
in float open_sky;
in float beyond;
uniform vec4 pin;
uniform float base;
uniform float hexagonal;  // 1: the sides across x of three prisms, 60° apart, are those of a hexagon; 0: one prism
out vec4 pixel;
// The edges of a pin are rounded: towards an edge, the normal turns to halfway between the two faces.
vec3 bevelled() {
  float width = 0.2 * min(pin.x, pin.y);
  vec3 inside = vec3(pin.xy - abs(place_on_top), rotation.z - world.z);
  vec3 towards = vec3(sign(place_on_top), 1.0);
  if (hexagonal > 0.5) {
    vec2 p = abs(place_on_top), oblique = vec2(0.5, 0.8660254);
    vec2 side = p.x > dot(p, oblique) ? vec2(1, 0) : oblique;
    inside.xy = vec2(pin.x - dot(p, side));
    towards.xy *= side;
  }
  vec3 tilt = clamp(1.0 - inside / width, 0.0, 1.0);
  tilt *= tilt * towards;
  vec3 n = normalize(mix(tilt, facing, abs(facing)));
  return vec3(mat2(rotation.x, rotation.y, -rotation.y, rotation.x) * n.xy, n.z);
}
void main() {
  float open = open_sky;
  vec3 c = albedo;
  if (abs(beyond) > 1.0) c *= 0.15;
  if (facing.z < 0.5) {
    open *= gap_sky((levels.y - world.z) / pin.w);
    if (world.z < levels.x) c *= 0.55;   // the shaft below the pin
  }
  pixel = vec4(lit_material(c, bevelled(), world, open, PIN_FINISH), 1.0);
}
)";

// Lighting is computed per vertex. For a top face levels.y is −1e30 and z is above levels.x, so neither
// factor darkens it.
constexpr const char* kPinFragmentFast = R"(
in vec4 shade;
flat in vec2 levels;
in float beyond;
#ifdef CLOSED
in vec2 across;
flat in vec2 gap;
flat in vec4 closed;
#endif
uniform vec4 pin;
out vec4 pixel;
#ifdef CLOSED
// The share of a pixel that lies in a gap. Narrow gaps would otherwise turn into a moire pattern.
vec2 gap_share(vec2 at, vec2 wide) {
  vec2 period = 0.5 * pin.w / pin.xy, half_gap = period - 1.0, from = period - abs(at);
  vec2 inside = min(from + 0.5 * wide, half_gap) - max(from - 0.5 * wide, -half_gap);
  return mix(clamp(inside / wide, 0.0, 1.0), half_gap / period, smoothstep(0.5 * period, 1.5 * period, wide));
}
#endif
void main() {
  float open = gap_sky((levels.y - shade.w) / pin.w) * (shade.w < levels.x ? 0.55 : 1.0);
  pixel = vec4(shade.rgb * sqrt(open), 1.0);
#ifdef CLOSED
  vec2 shares = gap_share(across, max(fwidth(across), 1e-4));
  shares *= vec2(across.x < 0.0 ? closed.x : closed.y, across.y < 0.0 ? closed.z : closed.w);
  pixel.rgb *= mix(1.0, gap.x, shares.x) * mix(1.0, gap.y, shares.y);
#else
  if (abs(beyond) > 1.0) pixel.rgb *= 0.4;
#endif
}
)";

}  // namespace

ShaderSources pin_shaders(RenderPass pass, bool closed) {
  const std::string head = shader_preamble(pass) + (closed ? "#define CLOSED\n" : "");
  switch (pass) {
    case RenderPass::kShadow:
      return {head + kPinVertex, head + kEmptyFragment};
    case RenderPass::kColourFast:
      return {head + kLighting + kPinVertex, head + kGapOcclusion + kPinFragmentFast};
    default:
      return {head + kPinVertex, head + kLighting + kGapOcclusion + kPinFragment};
  }
}

}  // namespace smartsurf::view
