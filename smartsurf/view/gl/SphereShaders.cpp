#include "smartsurf/view/gl/ShaderChunks.h"

namespace smartsurf::view {
namespace {

constexpr const char* kSphereVertex = R"(
layout(location = 0) in vec2 corner;
out vec3 world;
flat out vec4 ball;     // centre, radius
flat out vec4 paint;    // colour, rim
flat out vec4 spin;
flat out vec4 look;
void main() {
  float radius = half_extent.x;
  vec3 back = -ray.xyz;
  float reach = radius;
  if (eye.w > 0.5) {
    vec3 d = eye.xyz - centre;
    float distance2 = max(dot(d, d), radius * radius * 1.0001);
    back = d * inversesqrt(distance2);
    // Radius of the silhouette at the depth of the centre.
    reach = radius * sqrt(distance2 / (distance2 - radius * radius));
  }
  vec3 side = normalize(abs(back.z) < 0.99 ? cross(vec3(0, 0, 1), back) : cross(vec3(0, 1, 0), back));
  world = centre + (side * corner.x + cross(back, side) * corner.y) * reach;
  ball = vec4(centre, radius);
  paint = colour;
  spin = orientation;
  look = finish;
  gl_Position = clip_from_world * vec4(world, 1.0);
}
)";

// The light sees a sphere as the disc through its centre: the silhouette is the same, and no lit point lies
// behind the disc. No depth is computed per fragment.
constexpr const char* kSphereShadowFragment = R"(
in vec3 world;
flat in vec4 ball;
void main() {
  vec3 offset = world - ball.xyz;
  if (dot(offset, offset) > ball.w * ball.w) discard;
}
)";

constexpr const char* kSphereFragment = R"(
in vec3 world;
flat in vec4 ball;
flat in vec4 paint;
flat in vec4 spin;
flat in vec4 look;
out vec4 pixel;
vec3 unrotate(vec4 q, vec3 v) { return v + 2.0 * cross(-q.xyz, cross(-q.xyz, v) + q.w * v); }
void main() {
  vec3 direction = normalize(world - eye.xyz);
  vec3 offset = world - ball.xyz;
  float b = dot(offset, direction);
  float under = b * b - dot(offset, offset) + ball.w * ball.w;
  if (under < 0.0) discard;
  vec3 hit = world - direction * (b + sqrt(under));
  vec4 clip = clip_from_world * vec4(hit, 1.0);
  gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
  vec3 n = (hit - ball.xyz) / ball.w;
  if (see_through(look, max(-dot(n, direction), 0.0))) discard;
  // A thin lighter band around the equator makes rolling visible.
  vec3 own = unrotate(spin, n);
  vec3 c = look.w > 0.5 && look.w < 1.5 ? grain(paint.rgb, own, 1.0) : paint.rgb;
  c = mix(c, vec3(1.0), 0.22 * (1.0 - smoothstep(0.04, 0.07, abs(own.z))));
  pixel = vec4(lit_material(c, n, hit, pocket_sky(hit, paint.w, 1.6 * ball.w), look), 1.0);
}
)";

// The variant for software renderers. The rays through one sphere are treated as parallel, and the shadow map
// is sampled at the corners of the disc only. The depth is that of the disc: along such a ray, everything
// that does not intersect the sphere lies in front of its near side or behind its far side, and the disc lies
// between them. Writing gl_FragDepth would disable the early depth test.
constexpr const char* kSphereVertexFast = R"(
layout(location = 0) in vec2 corner;
out vec2 place;             // position on the disc of radius 1
out float lit_share;        // visibility of the sun
flat out vec3 sun_way, half_way, up_way, axis;   // in the disc's frame: right, up, towards the eye
flat out vec3 paint;
flat out float gloss;       // strength of the highlight
flat out vec2 pocket;       // depth of the centre below the rim and radius, in units of pocket_sky's size
void main() {
  float radius = half_extent.x;
  vec3 back = eye.w > 0.5 ? normalize(eye.xyz - centre) : -ray.xyz;
  vec3 side = normalize(abs(back.z) < 0.99 ? cross(vec3(0, 0, 1), back) : cross(vec3(0, 1, 0), back));
  mat3 frame = mat3(side, cross(back, side), back);
  vec3 p = centre + radius * (frame * vec3(corner, 0.0));
  gl_Position = clip_from_world * vec4(p, 1.0);
  place = corner;
  sun_way = light.xyz * frame;
  half_way = normalize(sun_way + vec3(0, 0, 1));
  up_way = vec3(0, 0, 1) * frame;
  axis = rotate(orientation, vec3(0, 0, 1)) * frame;
  paint = colour.rgb;
  gloss = 0.5 * (1.0 - finish.x) * (1.0 - finish.x) + finish.y;
  pocket = vec2(colour.w - centre.z, radius) / (1.6 * radius);
  // Sample on the sunward side of the sphere's own shadow disc.
  vec3 seen = centre + 0.7 * (p - centre);
  seen += light.xyz * max(0.0, 0.3 * radius - dot(seen - centre, light.xyz));
  lit_share = sun_visibility(seen, light.xyz);
}
)";

constexpr const char* kSphereFragmentFast = R"(
in vec2 place;
in float lit_share;
flat in vec3 sun_way, half_way, up_way, axis;
flat in vec3 paint;
flat in float gloss;
flat in vec2 pocket;
out vec4 pixel;
void main() {
  float reach = dot(place, place);
  if (reach > 1.0) discard;
  vec3 n = vec3(place, sqrt(1.0 - reach));
  float up = dot(n, up_way);
  float open = 1.0 - 0.55 * clamp(pocket.x - pocket.y * up, 0.0, 1.0);
  float band = clamp((0.07 - abs(dot(n, axis))) / 0.03, 0.0, 1.0);
  vec3 albedo = mix(paint, vec3(1.0), 0.22 * band);
  float facing = max(dot(n, sun_way), 0.0);
  float shine = max(dot(n, half_way), 0.0);
  shine *= shine; shine *= shine; shine *= shine; shine *= shine;   // to the 16th power
  shine *= shine * shine;
  float grazing = 1.0 - n.z;
  vec3 c = ambient(up) * (albedo + gloss * 0.5 * grazing * grazing) * open;
  c += sun.rgb * (albedo * facing + (facing > 0.0 ? gloss * shine : 0.0)) * sun_share(lit_share, open);
  pixel = vec4(to_screen(c), 1.0);
}
)";

}  // namespace

ShaderSources sphere_shaders(RenderPass pass) {
  const std::string head = shader_preamble(pass), vertex = head + kObjectAttributes;
  switch (pass) {
    case RenderPass::kShadow:
      return {vertex + kSphereVertex, head + kSphereShadowFragment};
    case RenderPass::kColourFast:
      return {vertex + kLighting + kSphereVertexFast, head + kLighting + kSphereFragmentFast};
    default:
      return {vertex + kSphereVertex, head + kLighting + kPocketOcclusion + kSphereFragment};
  }
}

}  // namespace smartsurf::view
