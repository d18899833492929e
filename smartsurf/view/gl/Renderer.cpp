#include "smartsurf/view/gl/Renderer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "smartsurf/view/gl/Layers.h"
#include "smartsurf/view/gl/ShadowMap.h"
#include "smartsurf/view/model/Axes.h"
#include "smartsurf/view/model/Palette.h"

namespace smartsurf::view {
namespace {

// Mirrors the block "Frame" in Shaders.cpp (std140).
struct FrameUniforms {
  Eigen::Matrix4f clip_from_world, shadow_from_world;
  std::array<float, 4> eye, ray, light, fog, table;
};
static_assert(sizeof(FrameUniforms) == 2 * 64 + 5 * 16);

// A cell that is drawn no wider than this, in the middle of the picture, is seen from afar.
constexpr double kFarCell_px = 24.0;

constexpr Rgb kBoard{0.20f, 0.21f, 0.23f};
constexpr Rgb kAxis[3] = {{0.80f, 0.16f, 0.14f}, {0.16f, 0.58f, 0.22f}, {0.14f, 0.32f, 0.82f}};

std::array<float, 3> floats(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

bool seen_from_afar(const scene::SurfaceSpec& surface, const Camera& camera, int height) {
  const double pixels_a_unit = 0.5 * height / (std::tan(camera.field_of_view() / 2.0) * camera.distance());
  return surface.pitch * pixels_a_unit < kFarCell_px;
}

std::array<float, 4> with_w(const Eigen::Vector3d& v, double w) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()),
          static_cast<float>(w)};
}

ObjectInstance upright_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high, const Rgb& screen) {
  const Rgb c = linear_light(screen);
  return {floats((low + high) / 2.0), floats((high - low) / 2.0), {0, 0, 0, 1}, {c[0], c[1], c[2], -1e9f}};
}

}  // namespace

struct Renderer::State {
  State(const scene::SceneSpec& s, const Quality& q)
      : spec(s),
        quality(q),
        colour_pass(q.light),
        shading(s.surface),
        shadow(q.shadow_size),
        pins(s.surface, colour_pass),
        mechanisms(s.surface, colour_pass),
        objects(colour_pass),
        ground(s.surface, colour_pass),
        frame(make_buffer()) {
    const auto source = average_shaders();
    average = link_program("average", source.vertex, source.fragment);
    empty_array = make_vertex_array();
  }

  void upload(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
              const Camera& camera, const DrawOptions& options);
  void add_furniture(const DrawOptions& options);
  ObjectInstance instance_of(const scene::Snapshot& snapshot, std::size_t i, const scene::ObjectSpec& object);
  void set_frame(const FrameUniforms& uniforms);
  FrameUniforms light_frame() const;
  FrameUniforms eye_frame(const Camera& camera, int width, int height) const;
  void draw_shadows(const DrawOptions& options);
  void draw_colour(const Camera& camera, const DrawOptions& options, int width, int height);
  void draw_pins(Pass pass, const PinLayer::Sight& sight);
  void draw_translucent();

  scene::SceneSpec spec;
  Quality quality;
  Pass colour_pass;
  PinShading shading;
  ShadowMap shadow;
  PinLayer pins;
  MechanismLayer mechanisms;
  ObjectLayer objects;
  GroundLayer ground;
  LineLayer lines;
  Buffer frame;
  ShaderProgram average;
  VertexArray empty_array;
  Canvas canvas;
  StageEnd stage_end;
  bool shadows_due() const { return frames % quality.frames_a_shadow == 0; }
  void end_stage(std::string_view stage) const {
    if (stage_end) stage_end(stage);
  }

  long frames = 0;            // drawn
  std::size_t furniture = 0;  // boxes that are no objects, first among them
  bool far = false;           // so far away that gaps between pins may be painted
};

void Renderer::State::add_furniture(const DrawOptions& options) {
  const Eigen::AlignedBox3d box = Camera::extent(spec.surface);
  const double pitch = spec.surface.pitch, rim = kBoardRim * pitch, thick = 0.12 * pitch;
  const Eigen::Vector3d low = box.min() - Eigen::Vector3d(rim, rim, 0.0);
  objects.add_box(upright_box(low, {box.max().x() + rim, box.max().y() + rim, low.z() + thick}, kBoard));
  furniture = 1;
  if (options.axes) {
    const Axes axes = axes_of(spec.surface);
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(axes.half_width);
    for (int i = 0; i < 3; ++i)
      objects.add_box(upright_box(axes.origin - half,
                                  axes.origin + half + axes.length * Eigen::Vector3d::Unit(i), kAxis[i]));
    furniture += 3;
  }
}

ObjectInstance Renderer::State::instance_of(const scene::Snapshot& snapshot, std::size_t i,
                                            const scene::ObjectSpec& object) {
  const Rgb c = linear_light({object.colour.r, object.colour.g, object.colour.b});
  const std::array<float, 3> half = floats(object.half_extents());
  const auto& p = snapshot.position[i];
  const float rim = shading.rim_height(snapshot, p[0], p[1], 1.25f * std::max(half[0], half[1]));
  return {p, half, snapshot.orientation[i], {c[0], c[1], c[2], rim}};
}

void Renderer::State::upload(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                             const Camera& camera, const DrawOptions& options) {
  // Near rows first: what is hidden behind them is then never shaded.
  const bool north_first = camera.forward().y() < 0.0, east_first = camera.forward().x() < 0.0;
  const std::span<const float> recess = mechanisms.upload(snapshot);
  pins.upload(shading.update(snapshot, catalogue, options, north_first, east_first, recess));
  objects.begin();
  add_furniture(options);
  Eigen::AlignedBox3d lit = Camera::extent(spec.surface);
  const Eigen::AlignedBox3d near = {lit.min() - lit.sizes() * 0.1, lit.max() + lit.sizes() * 0.1};
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const scene::ObjectSpec& object = catalogue[snapshot.id[i]];
    objects.add(object, instance_of(snapshot, i, object));
    const auto& p = snapshot.position[i];
    const double radius = object.half_extents().norm();
    const Eigen::Vector3d at(p[0], p[1],
                             std::min<double>(p[2] + radius, near.max().z() + lit.sizes().maxCoeff()));
    if (at.x() > near.min().x() && at.x() < near.max().x() && at.y() > near.min().y() &&
        at.y() < near.max().y() && std::isfinite(at.z()))
      lit.extend(at);
  }
  objects.upload();
  lines.upload(options.lines);
  if (shadows_due()) shadow.fit(lit, spec.surface.pitch);
}

void Renderer::State::set_frame(const FrameUniforms& uniforms) {
  glBindBuffer(GL_UNIFORM_BUFFER, frame.id());
  glBufferData(GL_UNIFORM_BUFFER, sizeof(uniforms), &uniforms, GL_STREAM_DRAW);
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, frame.id());
}

FrameUniforms Renderer::State::light_frame() const {
  FrameUniforms u{};
  u.clip_from_world = shadow.clip_from_world();
  u.ray = with_w(-ShadowMap::towards_light(), 0.0);
  return u;
}

FrameUniforms Renderer::State::eye_frame(const Camera& camera, int width, int height) const {
  FrameUniforms u{};
  const double aspect = static_cast<double>(width) / height;
  u.clip_from_world = (camera.projection_matrix(aspect) * camera.view_matrix()).cast<float>();
  u.shadow_from_world = shadow.texture_from_world();
  u.eye = with_w(camera.eye(), 1.0);
  u.ray = with_w(camera.forward(), shadow.softness());
  u.light = with_w(ShadowMap::towards_light(), shadow.texel());
  const Eigen::AlignedBox3d box = Camera::extent(spec.surface);
  const double radius = 0.5 * box.diagonal().norm();
  u.fog = {static_cast<float>(camera.distance() + 1.5 * radius),
           static_cast<float>(camera.distance() + 9.0 * radius), static_cast<float>(width),
           static_cast<float>(height)};
  u.table = {static_cast<float>(box.min().x()), static_cast<float>(box.min().y()),
             static_cast<float>(box.max().x()), static_cast<float>(box.max().y())};
  return u;
}

void Renderer::State::draw_pins(Pass pass, const PinLayer::Sight& sight) {
  if (far && pins.can_close())
    pins.draw_closed(pass, sight);
  else
    pins.draw(pass);
}

void Renderer::State::draw_shadows(const DrawOptions& options) {
  set_frame(light_frame());
  shadow.begin();
  draw_pins(Pass::kShadow, {ShadowMap::towards_light().head<2>().cast<float>(), true});
  mechanisms.draw(Pass::kShadow, false);
  if (options.style == Style::kSolid)
    objects.draw(Pass::kShadow);
  else
    objects.draw_solid_boxes(Pass::kShadow, static_cast<int>(furniture));
  shadow.end();
}

void Renderer::State::draw_colour(const Camera& camera, const DrawOptions& options, int width, int height) {
  glViewport(0, 0, width, height);
  glClear(GL_DEPTH_BUFFER_BIT);
  shadow.bind(0);
  draw_pins(colour_pass, {camera.eye().head<2>().cast<float>(), false});
  mechanisms.draw(colour_pass, false);
  end_stage("pins");
  if (options.style == Style::kSolid)
    objects.draw(colour_pass);
  else
    objects.draw_solid_boxes(colour_pass, static_cast<int>(furniture));
  end_stage("objects");
  if (spec.world.ground) ground.draw_ground(options.grid, shadow.shade_on(ground_height(spec.surface)));
  glDepthFunc(GL_LEQUAL);
  ground.draw_backdrop();
  glDepthFunc(GL_LESS);
  if (options.style == Style::kWireframe) {
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    objects.draw_wires(1.3f * static_cast<float>(quality.supersample), static_cast<int>(furniture));
    glDisable(GL_BLEND);
  }
  draw_translucent();
  lines.draw(options.line_width * static_cast<float>(quality.supersample), width, height);
  end_stage("ground, wires, lines");
}

// What one sees through hides nothing of its own kind.
void Renderer::State::draw_translucent() {
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glDepthMask(GL_FALSE);
  mechanisms.draw(colour_pass, true);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

Renderer::Renderer(const scene::SceneSpec& spec, const Quality& quality) {
  if (epoxy_gl_version() < 33)
    throw std::runtime_error(
        "OpenGL 3.3 is needed and this driver offers less; the packages libgl1-mesa-dri "
        "libegl1 bring a software one");
  state_ = std::make_unique<State>(spec, quality);
}

Renderer::~Renderer() = default;

void Renderer::set_stage_end(StageEnd stage_end) { state_->stage_end = std::move(stage_end); }

void Renderer::draw(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                    const Camera& camera, const DrawOptions& options, unsigned framebuffer, int width,
                    int height) {
  State& s = *state_;
  assert(snapshot.height.size() == static_cast<std::size_t>(s.spec.surface.cell_count()));
  assert(options.cell_values.empty() || options.cell_values.size() == snapshot.height.size());
  const int block = s.quality.supersample;
  s.far = seen_from_afar(s.spec.surface, camera, height * block);
  s.upload(snapshot, catalogue, camera, options);
  s.end_stage("values");
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  glDisable(GL_SCISSOR_TEST);
  if (s.shadows_due()) s.draw_shadows(options);
  s.end_stage("shadows");
  ++s.frames;
  if (block > 1) s.canvas.resize(width * block, height * block);
  glBindFramebuffer(GL_FRAMEBUFFER, block > 1 ? s.canvas.framebuffer.id() : framebuffer);
  s.set_frame(s.eye_frame(camera, width * block, height * block));
  s.draw_colour(camera, options, width * block, height * block);
  if (block > 1) {
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glViewport(0, 0, width, height);
    glDisable(GL_DEPTH_TEST);
    glActiveTexture(GL_TEXTURE1);
    glBindTexture(GL_TEXTURE_2D, s.canvas.colour.id());
    glUseProgram(s.average.id());
    glUniform1i(glGetUniformLocation(s.average.id(), "picture"), 1);
    glUniform1i(glGetUniformLocation(s.average.id(), "block"), block);
    glBindVertexArray(s.empty_array.id());
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glActiveTexture(GL_TEXTURE0);
    s.end_stage("average");
  }
  glBindVertexArray(0);
  assert(glGetError() == GL_NO_ERROR);
}

}  // namespace smartsurf::view
