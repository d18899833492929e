#include <cstddef>

#include "smartsurf/view/gl/Layers.h"

namespace smartsurf::view {

ActuatorLayer::ActuatorLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass) : geometry_(surface) {
  if (geometry_.meshes().empty()) return;
  const auto shadow = two_colour_mesh_shaders(RenderPass::kShadow),
             colour = two_colour_mesh_shaders(colour_pass);
  shadow_ = link_program("actuator shadow", shadow.vertex, shadow.fragment);
  colour_ = link_program("actuator", colour.vertex, colour.fragment);
  for (const InstancedMesh& mesh : geometry_.meshes()) {
    MeshBuffers buffers{make_vertex_array(), make_buffer(), make_buffer(), make_buffer()};
    glBindVertexArray(buffers.vertex_array.id());
    upload_buffer(GL_ARRAY_BUFFER, buffers.vertex_buffer, mesh.mesh.vertices, GL_STATIC_DRAW);
    set_vertex_attribute(0, 3, 7, 0);
    set_vertex_attribute(1, 3, 7, 3);
    set_vertex_attribute(2, 1, 7, 6);
    upload_buffer(GL_ELEMENT_ARRAY_BUFFER, buffers.index_buffer, mesh.mesh.indices, GL_STATIC_DRAW);
    glBindBuffer(GL_ARRAY_BUFFER, buffers.instance_buffer.id());
    set_instance_attribute<MeshInstance>(3, 3, GL_FLOAT, offsetof(MeshInstance, x));
    set_instance_attribute<MeshInstance>(4, 3, GL_FLOAT, offsetof(MeshInstance, y));
    set_instance_attribute<MeshInstance>(5, 3, GL_FLOAT, offsetof(MeshInstance, z));
    set_instance_attribute<MeshInstance>(6, 3, GL_FLOAT, offsetof(MeshInstance, centre));
    set_instance_attribute<MeshInstance>(7, 4, GL_UNSIGNED_BYTE, offsetof(MeshInstance, base_colour));
    set_instance_attribute<MeshInstance>(8, 4, GL_UNSIGNED_BYTE, offsetof(MeshInstance, accent_colour));
    buffers_.push_back(std::move(buffers));
  }
  glBindVertexArray(0);
}

std::span<const float> ActuatorLayer::upload(const scene::Snapshot& snapshot) {
  if (buffers_.empty()) return {};
  geometry_.update(snapshot);
  for (std::size_t k = 0; k < buffers_.size(); ++k) {
    const InstancedMesh& mesh = geometry_.meshes()[k];
    upload_buffer(GL_ARRAY_BUFFER, buffers_[k].instance_buffer, mesh.instances, GL_STREAM_DRAW);
    if (mesh.deforms)
      upload_buffer(GL_ARRAY_BUFFER, buffers_[k].vertex_buffer, mesh.mesh.vertices, GL_STREAM_DRAW);
  }
  return geometry_.recess();
}

void ActuatorLayer::draw(RenderPass pass, bool translucent) const {
  if (buffers_.empty()) return;
  glUseProgram(pass == RenderPass::kShadow ? shadow_.id() : colour_.id());
  for (std::size_t k = 0; k < buffers_.size(); ++k) {
    const InstancedMesh& mesh = geometry_.meshes()[k];
    if (mesh.translucent != translucent || mesh.instances.empty()) continue;
    glBindVertexArray(buffers_[k].vertex_array.id());
    glDrawElementsInstanced(GL_TRIANGLES, static_cast<GLsizei>(mesh.mesh.indices.size()), GL_UNSIGNED_INT,
                            nullptr, static_cast<GLsizei>(mesh.instances.size()));
  }
}

}  // namespace smartsurf::view
