#include "smartsurf/view/gl/Shaders.h"

#include "smartsurf/view/gl/ShaderChunks.h"

namespace smartsurf::view {
namespace {

constexpr const char* kMeshVertex = R"(
layout(location = 0) in vec3 corner;
layout(location = 5) in vec3 corner_normal;
out vec3 world;
out vec3 normal;
flat out vec4 paint;
flat out float size;
void main() {
  world = centre + rotate(orientation, placed(corner));
#ifdef CAPSULE
  normal = rotate(orientation, corner_normal);
#else
  normal = rotate(orientation, normalize(corner_normal / half_extent));
#endif
  paint = colour;
  size = min(half_extent.x, min(half_extent.y, half_extent.z));
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kMeshFragment = R"(
in vec3 world;
in vec3 normal;
flat in vec4 paint;
flat in float size;
out vec4 pixel;
void main() {
  pixel = vec4(lit_glossy(paint.rgb, normalize(normal), world, pocket_sky(world, paint.w, 2.0 * size), 0.12), 1.0);
}
)";

// The colour of the halo that sets off a line from any background.
constexpr const char* kHalo = R"(
vec3 halo(vec3 screen) { return vec3(dot(screen, vec3(0.30, 0.59, 0.11)) > 0.45 ? 0.05 : 1.0); }
)";

constexpr const char* kWireframeVertex = R"(
uniform float is_halo;   // 1: the halo of the wires
layout(location = 0) in vec3 corner;
out vec4 paint;
void main() {
  vec3 world = centre + rotate(orientation, placed(corner));
  vec3 out_of_surface = normalize(rotate(orientation, corner));
  // Lines on the far side are fainter, which shows the shape.
  float near = dot(out_of_surface, normalize(eye.xyz - world)) > 0.0 ? 1.0 : 0.35;
  vec3 screen = pow(colour.rgb, vec3(1.0 / 2.2)) * 0.85;
  paint = is_halo > 0.5 ? vec4(halo(screen), 0.75 * near * near) : vec4(screen, near);
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kTwoColourVertex = R"(
layout(location = 0) in vec3 corner;
layout(location = 1) in vec3 corner_normal;
layout(location = 2) in float weight;      // share of the accent colour
layout(location = 3) in vec3 x;            // scaled axes of the instance
layout(location = 4) in vec3 y;
layout(location = 5) in vec3 z;
layout(location = 6) in vec3 centre;
layout(location = 7) in vec4 paint;
layout(location = 8) in vec4 mark;
out vec3 world;
out vec3 normal;
out vec4 colour;
void main() {
  world = centre + x * corner.x + y * corner.y + z * corner.z;
  normal = cross(y, z) * corner_normal.x + cross(z, x) * corner_normal.y + cross(x, y) * corner_normal.z;
  colour = mix(paint, mark, weight);
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kTwoColourFragment = R"(
in vec3 world;
in vec3 normal;
in vec4 colour;
out vec4 pixel;
void main() {
  if (colour.a < 0.99)
    pixel = vec4(to_screen(colour.rgb), colour.a);
  else
    pixel = vec4(lit_glossy(colour.rgb, normalize(normal), world, 0.95, 0.08), 1.0);
}
)";

constexpr const char* kGroundVertex = R"(
layout(location = 0) in vec2 corner;   // ±1: of the shaded rectangle; ±2: of the whole ground
uniform float base;     // z of the ground
uniform float reach;    // half the ground's edge
uniform vec4 shaded;    // x0, y0, x1, y1 of the ground that shadows may fall on
out vec3 world;
#ifdef UNSHADED
flat out vec3 plain;    // lit colour, constant outside the shaded rectangle
#endif
void main() {
  vec2 near = mix(shaded.xy, shaded.zw, step(0.0, corner));
  vec2 far = 0.5 * (table.xy + table.zw) + reach * sign(corner);
  world = vec3(abs(corner.x) > 1.5 ? far : near, base);
#ifdef UNSHADED
  plain = lit(kGround, vec3(0, 0, 1), world, 1.0);
#endif
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

constexpr const char* kBackdropFunction = R"(
vec3 backdrop(float y) { return mix(vec3(0.86, 0.88, 0.905), vec3(0.965, 0.972, 0.98), clamp(y, 0.0, 1.0)); }
)";

constexpr const char* kGroundFragment = R"(
in vec3 world;
#ifdef UNSHADED
flat in vec3 plain;
#endif
uniform float spacing;   // between grid lines, u; 0: no grid
out vec4 pixel;
void main() {
#ifdef UNSHADED
  vec3 c = plain;
#else
  vec2 out_of_table = max(max(table.xy - world.xy, world.xy - table.zw), 0.0);
  float sky = 0.62 + 0.38 * smoothstep(0.0, 6.0, length(out_of_table));
  vec3 c = lit(kGround, vec3(0, 0, 1), world, sky);
#endif
  if (spacing > 0.0) {
    vec2 at = world.xy / spacing, pixel_wide = fwidth(at);
    vec2 line = smoothstep(0.0, 1.0, 1.0 - abs(fract(at - 0.5) - 0.5) / max(pixel_wide, 1e-6));
    c *= 1.0 - 0.14 * max(line.x, line.y) * (1.0 - smoothstep(0.08, 0.35, max(pixel_wide.x, pixel_wide.y)));
  }
#ifdef FAST
  float away = 1.0 / gl_FragCoord.w;   // view-space depth
#else
  float away = length(world - eye.xyz);
#endif
  float far = smoothstep(fog.x, fog.y, away);
  pixel = vec4(mix(c, backdrop(gl_FragCoord.y / fog.w), far), 1.0);
}
)";

std::string shape_define(bool capsule) { return capsule ? "#define CAPSULE\n" : ""; }

}  // namespace

ShaderSources mesh_shaders(RenderPass pass, bool capsule) {
  return {shader_preamble(pass) + shape_define(capsule) + kObjectAttributes + kMeshVertex,
          shader_preamble(pass) + (pass == RenderPass::kShadow
                                       ? std::string(kEmptyFragment)
                                       : std::string(kLighting) + kPocketOcclusion + kMeshFragment)};
}

ShaderSources wireframe_shaders(bool capsule) {
  return {shader_preamble(RenderPass::kColour) + shape_define(capsule) + kObjectAttributes + kHalo +
              kWireframeVertex,
          "#version 330 core\nin vec4 paint;\nout vec4 pixel;\nvoid main() { pixel = paint; }\n"};
}

ShaderSources two_colour_mesh_shaders(RenderPass pass) {
  return {
      shader_preamble(pass) + kTwoColourVertex,
      shader_preamble(pass) + (pass == RenderPass::kShadow ? std::string(kEmptyFragment)
                                                           : std::string(kLighting) + kTwoColourFragment)};
}

ShaderSources line_shaders() {
  return {shader_preamble(RenderPass::kColour) + kHalo + R"(
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in vec4 colour;
uniform vec3 picture;    // viewport size and line width, pixels
uniform vec2 style;      // 1: the halo; opacity
out vec4 paint;
const float kNear = 1e-3;
void main() {
  vec4 a = clip_from_world * vec4(from, 1.0), b = clip_from_world * vec4(to, 1.0);
  // Clip at the eye before the division by w.
  if (a.w < kNear && b.w >= kNear) a = mix(a, b, (kNear - a.w) / (b.w - a.w));
  else if (b.w < kNear && a.w >= kNear) b = mix(b, a, (kNear - b.w) / (a.w - b.w));
  vec2 along = (b.xy / b.w - a.xy / a.w) * picture.xy;
  along = dot(along, along) > 1e-8 ? normalize(along) : vec2(1.0, 0.0);
  vec4 end = gl_VertexID < 2 ? a : b;
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  end.xy += vec2(-along.y, along.x) * side * picture.z / picture.xy * end.w;
  end.z -= 2e-4 * end.w;   // against z-fighting with the surface the line lies on
  paint = vec4(style.x > 0.5 ? halo(colour.rgb) : colour.rgb, colour.a * style.y);
  if (style.x > 0.5) end.z += 1e-4 * end.w;   // behind its line
  gl_Position = end;
}
)",
          "#version 330 core\nin vec4 paint;\nout vec4 pixel;\nvoid main() { pixel = paint; }\n"};
}

ShaderSources ground_shaders(RenderPass pass, bool shadowed) {
  const std::string head = shader_preamble(pass) + (shadowed ? "" : "#define UNSHADED\n") +
                           "const vec3 kGround = vec3(0.66, 0.675, 0.70);\n";
  return {head + (shadowed ? "" : kLighting) + kGroundVertex,
          head + kLighting + kBackdropFunction + kGroundFragment};
}

ShaderSources backdrop_shaders() {
  return {shader_preamble(RenderPass::kColour) + R"(
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 1.0, 1.0); }
)",
          shader_preamble(RenderPass::kColour) + kBackdropFunction + R"(
out vec4 pixel;
void main() { pixel = vec4(backdrop(gl_FragCoord.y / fog.w), 1.0); }
)"};
}

ShaderSources downsample_shaders() {
  return {R"(#version 330 core
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
)",
          R"(#version 330 core
uniform sampler2D picture;
uniform int block;
out vec4 pixel;
void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * block;
  vec4 sum = vec4(0.0);
  for (int y = 0; y < block; ++y)
    for (int x = 0; x < block; ++x) sum += texelFetch(picture, first + ivec2(x, y), 0);
  pixel = sum / float(block * block);
}
)"};
}

}  // namespace smartsurf::view
