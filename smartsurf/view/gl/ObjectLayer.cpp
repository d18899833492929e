#include <algorithm>
#include <cstddef>

#include "smartsurf/view/gl/Layers.h"
#include "smartsurf/view/model/Meshes.h"

namespace smartsurf::view {
namespace {

using scene::ShapeKind;

// OpenGL 3.3 has no base instance, so the attribute offsets select the first instance.
void bind_instance_attributes(GLuint buffer, GLsizei first = 0) {
  const std::size_t start = first * sizeof(ObjectInstance);
  glBindBuffer(GL_ARRAY_BUFFER, buffer);
  set_instance_attribute<ObjectInstance>(1, 3, GL_FLOAT, start + offsetof(ObjectInstance, centre));
  set_instance_attribute<ObjectInstance>(2, 3, GL_FLOAT, start + offsetof(ObjectInstance, half_extent));
  set_instance_attribute<ObjectInstance>(3, 4, GL_FLOAT, start + offsetof(ObjectInstance, orientation));
  set_instance_attribute<ObjectInstance>(4, 4, GL_FLOAT, start + offsetof(ObjectInstance, colour));
  set_instance_attribute<ObjectInstance>(6, 4, GL_FLOAT, start + offsetof(ObjectInstance, finish));
}

// The octagon around the unit circle, x, y per corner. Fewer fragments are discarded than with a square.
std::vector<float> circumscribed_octagon() {
  constexpr float kSide = 0.41421357f;  // half an edge: tan(π/8)
  return {kSide, -1, 1, -kSide, 1, kSide, kSide, 1, -kSide, 1, -1, kSide, -1, -kSide, -kSide, -1};
}

}  // namespace

ObjectLayer::ObjectLayer(RenderPass colour_pass) {
  const int segments = colour_pass == RenderPass::kColourFine   ? 64
                       : colour_pass == RenderPass::kColourFast ? 16
                                                                : 24;
  sphere_.link("sphere", sphere_shaders(RenderPass::kShadow), sphere_shaders(colour_pass),
               wireframe_shaders(false));
  mesh_.link("mesh", mesh_shaders(RenderPass::kShadow, false), mesh_shaders(colour_pass, false),
             wireframe_shaders(false));
  capsule_.link("capsule", mesh_shaders(RenderPass::kShadow, true), mesh_shaders(colour_pass, true),
                wireframe_shaders(true));
  const auto init = [this](ShapeKind shape, const Programs& programs, const Mesh& mesh,
                           const std::vector<float>& wireframe) {
    init_batch(batch_of(shape), programs, 6, mesh.vertices, mesh.indices, wireframe);
  };
  init_batch(batch_of(ShapeKind::kSphere), sphere_, 2, circumscribed_octagon(),
             {0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5, 0, 5, 6, 0, 6, 7}, sphere_wireframe());
  init(ShapeKind::kBox, mesh_, box_mesh(), box_wireframe());
  init(ShapeKind::kCylinder, mesh_, cylinder_mesh(segments), cylinder_wireframe());
  init(ShapeKind::kCapsule, capsule_, capsule_mesh(segments), capsule_wireframe());
  init(ShapeKind::kCone, mesh_, cone_mesh(segments), cone_wireframe());
}

void ObjectLayer::Programs::link(const char* name, const ShaderSources& shadow_source,
                                 const ShaderSources& colour_source, const ShaderSources& wireframe_source) {
  shadow = link_program(std::string(name) + " shadow", shadow_source.vertex, shadow_source.fragment);
  colour = link_program(name, colour_source.vertex, colour_source.fragment);
  wireframe = link_program(std::string(name) + " wires", wireframe_source.vertex, wireframe_source.fragment);
}

void ObjectLayer::init_batch(ShapeBatch& batch, const Programs& programs, int floats_per_vertex,
                             const std::vector<float>& mesh, const std::vector<std::uint32_t>& triangles,
                             const std::vector<float>& wireframe) {
  batch.programs = &programs;
  batch.vertex_array = make_vertex_array();
  batch.wireframe_vertex_array = make_vertex_array();
  batch.vertex_buffer = make_buffer();
  batch.wireframe_buffer = make_buffer();
  batch.instance_buffer = make_buffer();
  batch.index_buffer = make_buffer();
  batch.index_count = static_cast<GLsizei>(triangles.size());
  batch.wireframe_vertex_count = static_cast<GLsizei>(wireframe.size()) / 3;
  glBindVertexArray(batch.vertex_array.id());
  upload_buffer(GL_ARRAY_BUFFER, batch.vertex_buffer, mesh, GL_STATIC_DRAW);
  set_vertex_attribute(0, floats_per_vertex == 2 ? 2 : 3, floats_per_vertex, 0);
  if (floats_per_vertex == 6) set_vertex_attribute(5, 3, floats_per_vertex, 3);
  upload_buffer(GL_ELEMENT_ARRAY_BUFFER, batch.index_buffer, triangles, GL_STATIC_DRAW);
  bind_instance_attributes(batch.instance_buffer.id());
  glBindVertexArray(batch.wireframe_vertex_array.id());
  upload_buffer(GL_ARRAY_BUFFER, batch.wireframe_buffer, wireframe, GL_STATIC_DRAW);
  set_vertex_attribute(0, 3, 3, 0);
  bind_instance_attributes(batch.instance_buffer.id());
  glBindVertexArray(0);
}

void ObjectLayer::clear_instances() {
  for (ShapeBatch& batch : batches_) batch.instances.clear();
  for (auto& [solid, batch] : solid_batches_) batch.instances.clear();
}

void ObjectLayer::add(const scene::ObjectSpec& object, ObjectInstance instance) {
  if (object.shape != ShapeKind::kSolid) {
    batch_of(object.shape).instances.push_back(instance);
    return;
  }
  if (!object.solid) return;
  auto batch = std::find_if(solid_batches_.begin(), solid_batches_.end(),
                            [&](const auto& s) { return s.first == object.solid; });
  if (batch == solid_batches_.end()) {
    batch = solid_batches_.insert(batch, {object.solid, ShapeBatch{}});
    const Mesh mesh = solid_mesh(*object.solid);
    init_batch(batch->second, mesh_, 6, mesh.vertices, mesh.indices, solid_wireframe(*object.solid));
  }
  instance.half_extent = {1.0f, 1.0f, 1.0f};  // the mesh of a solid is not normalised
  batch->second.instances.push_back(instance);
}

void ObjectLayer::add_box(const ObjectInstance& instance) { batches_[kBoxes].instances.push_back(instance); }

void ObjectLayer::upload() {
  const auto upload_batch = [](ShapeBatch& batch) {
    batch.instance_count = static_cast<GLsizei>(batch.instances.size());
    if (batch.instance_count == 0) return;
    upload_buffer(GL_ARRAY_BUFFER, batch.instance_buffer, batch.instances, GL_STREAM_DRAW);
  };
  for (ShapeBatch& batch : batches_) upload_batch(batch);
  for (auto& [solid, batch] : solid_batches_) upload_batch(batch);
}

template <class Action>
void ObjectLayer::for_each_batch(Action action) const {
  for (const ShapeBatch& batch : batches_) action(batch);
  for (const auto& [solid, batch] : solid_batches_) action(batch);
}

void ObjectLayer::draw(RenderPass pass) const {
  for_each_batch([pass](const ShapeBatch& batch) {
    if (batch.instance_count == 0) return;
    glUseProgram(pass == RenderPass::kShadow ? batch.programs->shadow.id() : batch.programs->colour.id());
    glBindVertexArray(batch.vertex_array.id());
    glDrawElementsInstanced(GL_TRIANGLES, batch.index_count, GL_UNSIGNED_INT, nullptr, batch.instance_count);
  });
}

void ObjectLayer::draw_static_boxes(RenderPass pass, GLsizei static_boxes) const {
  const ShapeBatch& boxes = batches_[kBoxes];
  glUseProgram(pass == RenderPass::kShadow ? boxes.programs->shadow.id() : boxes.programs->colour.id());
  glBindVertexArray(boxes.vertex_array.id());
  glDrawElementsInstanced(GL_TRIANGLES, boxes.index_count, GL_UNSIGNED_INT, nullptr, static_boxes);
}

void ObjectLayer::draw_wireframes(float line_width, GLsizei static_boxes) const {
  std::array<GLfloat, 2> widths{1.0f, 1.0f};
  glGetFloatv(GL_ALIASED_LINE_WIDTH_RANGE, widths.data());
  const auto draw_pass = [&](float width, float is_halo) {
    glLineWidth(std::min(width, widths[1]));
    for_each_batch([&](const ShapeBatch& batch) {
      const GLsizei first = &batch == &batches_[kBoxes] ? static_boxes : 0;
      if (batch.instance_count <= first) return;
      const GLuint program = batch.programs->wireframe.id();
      glUseProgram(program);
      glUniform1f(glGetUniformLocation(program, "is_halo"), is_halo);
      glBindVertexArray(batch.wireframe_vertex_array.id());
      bind_instance_attributes(batch.instance_buffer.id(), first);
      glDrawArraysInstanced(GL_LINES, 0, batch.wireframe_vertex_count, batch.instance_count - first);
    });
  };
  glDepthMask(GL_FALSE);
  draw_pass(2.5f * line_width, 1.0f);
  glDepthMask(GL_TRUE);
  draw_pass(line_width, 0.0f);
  glLineWidth(1.0f);
}

}  // namespace smartsurf::view
