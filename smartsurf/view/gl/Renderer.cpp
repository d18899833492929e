#include "smartsurf/view/gl/Renderer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "smartsurf/view/gl/Layers.h"
#include "smartsurf/view/gl/ShadowMap.h"
#include "smartsurf/view/model/Float3.h"
#include "smartsurf/view/model/Palette.h"
#include "smartsurf/view/model/StageModel.h"
#include "smartsurf/view/model/TableBounds.h"

namespace smartsurf::view {
namespace {

// Mirrors the uniform block "Frame" in ShaderChunks.cpp (std140).
struct FrameUniforms {
  Eigen::Matrix4f clip_from_world, shadow_from_world;
  std::array<float, 4> eye, ray, light, fog, table, sun, sky, bounce, floor_paint, horizon, zenith;
};
static_assert(sizeof(FrameUniforms) == 2 * 64 + 11 * 16);

constexpr double kOcclusionReach = 2.5;      // radius, pitches
constexpr float kMaxOcclusionReach = 0.12f;  // radius, share of the picture's height

// If a cell at the camera's target is narrower than this, its gaps may be painted (draw_closed_gaps).
constexpr double kDistantCell_px = 24.0;

bool is_distant(const scene::SurfaceSpec& surface, const Camera& camera, int height) {
  const double pixels_per_unit = 0.5 * height / (std::tan(camera.field_of_view() / 2.0) * camera.distance());
  return surface.pitch * pixels_per_unit < kDistantCell_px;
}

std::array<float, 4> to_float4(const Eigen::Vector3d& v, double w) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()),
          static_cast<float>(w)};
}

ObjectInstance axis_aligned_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high, const Rgb& srgb) {
  const Rgb c = linear_light(srgb);
  return {to_float3((low + high) / 2.0),
          to_float3((high - low) / 2.0),
          {0, 0, 0, 1},
          {c[0], c[1], c[2], -1e9f},
          kPlainFinish};
}

}  // namespace

struct Renderer::State {
  State(const scene::SceneSpec& s, const RenderQuality& q)
      : spec(s),
        quality(q),
        colour_pass(q.colour_pass),
        shading(s.surface),
        shadow(q.shadow_map_size),
        pins(s.surface, colour_pass),
        actuators(s.surface, colour_pass),
        objects(colour_pass),
        ground(s.surface, colour_pass),
        uniform_buffer(make_buffer()) {
    if (quality.supersample < 2) return;
    const auto source = resolve_shaders();
    resolve = link_program("average", source.vertex, source.fragment);
    if (quality.occlusion) {
      const auto obscurance = occlusion_shaders();
      occlusion = link_program("occlusion", obscurance.vertex, obscurance.fragment);
    }
    empty_vertex_array = make_vertex_array();
  }

  void upload(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
              const Camera& camera, const DrawOptions& options);
  void add_static_boxes(const DrawOptions& options);
  ObjectInstance make_instance(const scene::Snapshot& snapshot, std::size_t i,
                               const scene::ObjectSpec& object);
  void upload_uniforms(const FrameUniforms& uniforms);
  FrameUniforms shadow_uniforms() const;
  FrameUniforms camera_uniforms(const Camera& camera, const DrawOptions& options, int width,
                                int height) const;
  void draw_shadow_pass(const DrawOptions& options);
  void draw_colour_pass(const Camera& camera, const DrawOptions& options, int width, int height);
  void draw_pins(RenderPass pass, const PinLayer::EyePosition& eye);
  void draw_translucent();
  void draw_occlusion(const Camera& camera, int width, int height);
  void resolve_samples(int width, int height) const;

  scene::SceneSpec spec;
  RenderQuality quality;
  RenderPass colour_pass;
  PinShading shading;
  ShadowMap shadow;
  PinLayer pins;
  ActuatorLayer actuators;
  ObjectLayer objects;
  GroundLayer ground;
  LineLayer lines;
  Buffer uniform_buffer;
  ShaderProgram occlusion, resolve;
  VertexArray empty_vertex_array;
  RenderTarget supersample_target;
  ColourTarget occlusion_target;
  StageCallback stage_callback;
  bool shadow_update_due() const { return frames_drawn % quality.frames_per_shadow_update == 0; }
  void report_stage(std::string_view stage) const {
    if (stage_callback) stage_callback(stage);
  }

  long frames_drawn = 0;
  std::size_t static_box_count = 0;  // the board and the axes, before the boxes of objects
  bool distant = false;              // gaps between pins may be painted
};

void Renderer::State::add_static_boxes(const DrawOptions& options) {
  const std::vector<StaticBox> boxes = static_boxes(spec.surface, options.axes);
  for (const StaticBox& box : boxes) objects.add_box(axis_aligned_box(box.low, box.high, box.colour));
  static_box_count = boxes.size();
}

ObjectInstance Renderer::State::make_instance(const scene::Snapshot& snapshot, std::size_t i,
                                              const scene::ObjectSpec& object) {
  const Rgb c = linear_light({object.colour.r, object.colour.g, object.colour.b});
  const std::array<float, 3> half = to_float3(object.half_extents());
  const auto& p = snapshot.position[i];
  const float surrounding_height =
      shading.mean_height_around(snapshot, p[0], p[1], 1.25f * std::max(half[0], half[1]));
  return {p, half, snapshot.orientation[i], {c[0], c[1], c[2], surrounding_height}, finish_of(spec, object)};
}

void Renderer::State::upload(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                             const Camera& camera, const DrawOptions& options) {
  // Front to back, so that the depth test rejects hidden fragments before they are shaded.
  const bool north_first = camera.forward().y() < 0.0, east_first = camera.forward().x() < 0.0;
  const std::span<const float> recess = actuators.upload(snapshot);
  pins.upload(
      shading.update(snapshot, catalogue, options, north_first, east_first, recess, near_walls(camera)));
  objects.clear_instances();
  add_static_boxes(options);
  // The shadow map covers the table and the objects near it. A far object would cost all others resolution.
  Eigen::AlignedBox3d shadow_bounds = surface_bounding_box(spec.surface);
  const Eigen::AlignedBox3d near_bounds = {shadow_bounds.min() - shadow_bounds.sizes() * 0.1,
                                           shadow_bounds.max() + shadow_bounds.sizes() * 0.1};
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const scene::ObjectSpec& object = catalogue[snapshot.id[i]];
    objects.add(object, make_instance(snapshot, i, object));
    const auto& p = snapshot.position[i];
    const double radius = object.half_extents().norm();
    const Eigen::Vector3d at(
        p[0], p[1],
        std::min<double>(p[2] + radius, near_bounds.max().z() + shadow_bounds.sizes().maxCoeff()));
    if (at.x() > near_bounds.min().x() && at.x() < near_bounds.max().x() && at.y() > near_bounds.min().y() &&
        at.y() < near_bounds.max().y() && std::isfinite(at.z()))
      shadow_bounds.extend(at);
  }
  objects.upload();
  lines.upload(options.lines);
  if (shadow_update_due()) shadow.fit(shadow_bounds, spec.surface.pitch);
}

void Renderer::State::upload_uniforms(const FrameUniforms& uniforms) {
  glBindBuffer(GL_UNIFORM_BUFFER, uniform_buffer.id());
  glBufferData(GL_UNIFORM_BUFFER, sizeof(uniforms), &uniforms, GL_STREAM_DRAW);
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, uniform_buffer.id());
}

FrameUniforms Renderer::State::shadow_uniforms() const {
  FrameUniforms u{};
  u.clip_from_world = shadow.clip_from_world();
  u.ray = to_float4(-towards_sun(), 0.0);
  return u;
}

FrameUniforms Renderer::State::camera_uniforms(const Camera& camera, const DrawOptions& options, int width,
                                               int height) const {
  FrameUniforms u{};
  const double aspect = static_cast<double>(width) / height;
  u.clip_from_world = (camera.projection_matrix(aspect) * camera.view_matrix()).cast<float>();
  u.shadow_from_world = shadow.texture_from_world();
  u.eye = to_float4(camera.eye(), 1.0);
  u.ray = to_float4(camera.forward(), shadow.penumbra_radius());
  u.light = to_float4(towards_sun(), shadow.texel_size());
  const Eigen::AlignedBox3d box = surface_bounding_box(spec.surface);
  const auto [clear, faded] = fading_distances(spec.surface, camera);
  u.fog = {static_cast<float>(clear), static_cast<float>(faded), static_cast<float>(width),
           static_cast<float>(height)};
  u.table = {static_cast<float>(box.min().x()), static_cast<float>(box.min().y()),
             static_cast<float>(box.max().x()), static_cast<float>(box.max().y())};
  const StageLight& stage = stage_light(options.stage);
  const auto with = [](const std::array<float, 3>& v, double w) {
    return std::array<float, 4>{v[0], v[1], v[2], static_cast<float>(w)};
  };
  u.sun = with(stage.sun, shadow.penumbra_spread());
  u.sky = with(stage.sky, stage.lamps);
  u.bounce = with(stage.bounce, 0.0);
  u.floor_paint = with(stage.floor_paint, stage.grid);
  u.horizon = with(stage.horizon, 0.0);
  u.zenith = with(stage.zenith, quality.supersample);
  return u;
}

void Renderer::State::draw_pins(RenderPass pass, const PinLayer::EyePosition& eye) {
  if (distant && pins.can_close_gaps())
    pins.draw_closed_gaps(pass, eye);
  else
    pins.draw(pass);
}

void Renderer::State::draw_shadow_pass(const DrawOptions& options) {
  upload_uniforms(shadow_uniforms());
  shadow.begin();
  draw_pins(RenderPass::kShadow, {towards_sun().head<2>().cast<float>(), true});
  actuators.draw(RenderPass::kShadow, false);
  if (options.fill_mode == FillMode::kSolid)
    objects.draw(RenderPass::kShadow);
  else
    objects.draw_static_boxes(RenderPass::kShadow, static_cast<int>(static_box_count));
  shadow.end();
}

void Renderer::State::draw_colour_pass(const Camera& camera, const DrawOptions& options, int width,
                                       int height) {
  glViewport(0, 0, width, height);
  glClear(GL_DEPTH_BUFFER_BIT);
  if (colour_pass == RenderPass::kColourFine) shadow.bind_depths(3);
  shadow.bind(0);
  draw_pins(colour_pass, {camera.eye().head<2>().cast<float>(), false});
  actuators.draw(colour_pass, false);
  report_stage("pins");
  if (options.fill_mode == FillMode::kSolid)
    objects.draw(colour_pass);
  else
    objects.draw_static_boxes(colour_pass, static_cast<int>(static_box_count));
  report_stage("objects");
  if (spec.world.ground)
    ground.draw_ground(options.grid, shadow.shadow_footprint(spec.surface.ground_height()));
  glDepthFunc(GL_LEQUAL);  // the backdrop lies on the far plane
  ground.draw_backdrop();
  glDepthFunc(GL_LESS);
  if (options.fill_mode == FillMode::kWireframe) {
    glEnable(GL_BLEND);
    blend_over();
    objects.draw_wireframes(1.3f * static_cast<float>(quality.supersample),
                            static_cast<int>(static_box_count));
    glDisable(GL_BLEND);
  }
  draw_translucent();
  lines.draw(options.line_width * static_cast<float>(quality.supersample), width, height);
  report_stage("ground, wires, lines");
}

// No depth writes: translucent parts do not hide each other.
void Renderer::State::draw_translucent() {
  glEnable(GL_BLEND);
  blend_over();
  glDepthMask(GL_FALSE);
  actuators.draw(colour_pass, true);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

void Renderer::State::draw_occlusion(const Camera& camera, int width, int height) {
  occlusion_target.resize(width, height);
  const Eigen::Matrix4d projection = camera.projection_matrix(static_cast<double>(width) / height);
  const double reach = kOcclusionReach * spec.surface.pitch;
  glBindFramebuffer(GL_FRAMEBUFFER, occlusion_target.framebuffer.id());
  glViewport(0, 0, width, height);
  glDisable(GL_DEPTH_TEST);
  glActiveTexture(GL_TEXTURE1);
  glBindTexture(GL_TEXTURE_2D, supersample_target.depth.id());
  const GLuint program = occlusion.id();
  glUseProgram(program);
  glUniform1i(glGetUniformLocation(program, "depths"), 1);
  glUniform4f(glGetUniformLocation(program, "lens"), static_cast<float>(1.0 / projection(0, 0)),
              static_cast<float>(1.0 / projection(1, 1)), static_cast<float>(projection(2, 2)),
              static_cast<float>(projection(2, 3)));
  glUniform4f(glGetUniformLocation(program, "reach"), static_cast<float>(reach),
              static_cast<float>(reach * projection(1, 1) * height / 2.0),
              kMaxOcclusionReach * static_cast<float>(height), static_cast<float>(quality.supersample));
  glBindVertexArray(empty_vertex_array.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

// Into the bound framebuffer.
void Renderer::State::resolve_samples(int width, int height) const {
  glViewport(0, 0, width, height);
  glDisable(GL_DEPTH_TEST);
  glActiveTexture(GL_TEXTURE2);
  glBindTexture(GL_TEXTURE_2D, occlusion_target.colour.id());
  glActiveTexture(GL_TEXTURE1);
  glBindTexture(GL_TEXTURE_2D, supersample_target.colour.id());
  const GLuint program = resolve.id();
  glUseProgram(program);
  glUniform1i(glGetUniformLocation(program, "picture"), 1);
  glUniform1i(glGetUniformLocation(program, "occlusion"), 2);
  glUniform1i(glGetUniformLocation(program, "block"), quality.supersample);
  glUniform1f(glGetUniformLocation(program, "occluded"), quality.occlusion ? 1.0f : 0.0f);
  glBindVertexArray(empty_vertex_array.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glActiveTexture(GL_TEXTURE0);
}

Renderer::Renderer(const scene::SceneSpec& spec, const RenderQuality& quality) {
  if (epoxy_gl_version() < 33)
    throw std::runtime_error(
        "the OpenGL driver does not support version 3.3; the packages libgl1-mesa-dri and "
        "libegl1 provide a software driver");
  state_ = std::make_unique<State>(spec, quality);
}

Renderer::~Renderer() = default;

void Renderer::set_stage_callback(StageCallback callback) { state_->stage_callback = std::move(callback); }

void Renderer::draw(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                    const Camera& camera, const DrawOptions& options, unsigned framebuffer, int width,
                    int height) {
  State& s = *state_;
  assert(std::ssize(snapshot.height) == s.spec.surface.cell_count());
  assert(options.cell_values.empty() || options.cell_values.size() == snapshot.height.size());
  const int supersample = s.quality.supersample;
  s.distant = is_distant(s.spec.surface, camera, height * supersample);
  s.upload(snapshot, catalogue, camera, options);
  s.report_stage("values");
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  glDisable(GL_SCISSOR_TEST);
  if (s.shadow_update_due()) s.draw_shadow_pass(options);
  s.report_stage("shadows");
  ++s.frames_drawn;
  if (supersample > 1) s.supersample_target.resize(width * supersample, height * supersample);
  glBindFramebuffer(GL_FRAMEBUFFER, supersample > 1 ? s.supersample_target.framebuffer.id() : framebuffer);
  s.upload_uniforms(s.camera_uniforms(camera, options, width * supersample, height * supersample));
  s.draw_colour_pass(camera, options, width * supersample, height * supersample);
  if (supersample > 1) {
    if (s.quality.occlusion) s.draw_occlusion(camera, width, height);
    s.report_stage("occlusion");
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    if (s.quality.occlusion || supersample != 2) {
      s.resolve_samples(width, height);
    } else {  // the linear filter is the mean of four samples
      glBindFramebuffer(GL_READ_FRAMEBUFFER, s.supersample_target.framebuffer.id());
      glBlitFramebuffer(0, 0, 2 * width, 2 * height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_LINEAR);
      glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
    }
    s.report_stage("average");
  }
  glBindVertexArray(0);
  assert(glGetError() == GL_NO_ERROR);
}

}  // namespace smartsurf::view
