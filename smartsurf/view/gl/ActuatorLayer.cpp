#include <cstddef>

#include "smartsurf/view/gl/Layers.h"

namespace smartsurf::view {
namespace {

void mesh_attribute(GLuint location, GLint size, std::size_t first) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, 7 * static_cast<int>(sizeof(float)),
                        reinterpret_cast<const void*>(first * sizeof(float)));
}

void instance_attribute(GLuint location, GLint size, GLenum type, std::size_t offset) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, type, type == GL_UNSIGNED_BYTE ? GL_TRUE : GL_FALSE,
                        sizeof(MeshInstance), reinterpret_cast<const void*>(offset));
  glVertexAttribDivisor(location, 1);
}

template <class T>
void load(GLenum target, GLuint buffer, const std::vector<T>& values, GLenum usage) {
  glBindBuffer(target, buffer);
  glBufferData(target, static_cast<GLsizeiptr>(values.size() * sizeof(T)), values.data(), usage);
}

}  // namespace

MechanismLayer::MechanismLayer(const scene::SurfaceSpec& surface, Pass colour_pass) : parts_(surface) {
  if (parts_.kinds().empty()) return;
  const auto shadow = part_shaders(Pass::kShadow), colour = part_shaders(colour_pass);
  shadow_ = link_program("part shadow", shadow.vertex, shadow.fragment);
  colour_ = link_program("part", colour.vertex, colour.fragment);
  for (const InstancedMesh& kind : parts_.kinds()) {
    Drawn d{make_vertex_array(), make_buffer(), make_buffer(), make_buffer()};
    glBindVertexArray(d.array.id());
    load(GL_ARRAY_BUFFER, d.corners.id(), kind.mesh.corners, GL_STATIC_DRAW);
    mesh_attribute(0, 3, 0);
    mesh_attribute(1, 3, 3);
    mesh_attribute(2, 1, 6);
    load(GL_ELEMENT_ARRAY_BUFFER, d.triangles.id(), kind.mesh.triangles, GL_STATIC_DRAW);
    glBindBuffer(GL_ARRAY_BUFFER, d.instances.id());
    instance_attribute(3, 3, GL_FLOAT, offsetof(MeshInstance, x));
    instance_attribute(4, 3, GL_FLOAT, offsetof(MeshInstance, y));
    instance_attribute(5, 3, GL_FLOAT, offsetof(MeshInstance, z));
    instance_attribute(6, 3, GL_FLOAT, offsetof(MeshInstance, centre));
    instance_attribute(7, 4, GL_UNSIGNED_BYTE, offsetof(MeshInstance, paint));
    instance_attribute(8, 4, GL_UNSIGNED_BYTE, offsetof(MeshInstance, mark));
    drawn_.push_back(std::move(d));
  }
  glBindVertexArray(0);
}

std::span<const float> MechanismLayer::upload(const scene::Snapshot& snapshot) {
  if (drawn_.empty()) return {};
  parts_.update(snapshot);
  for (std::size_t k = 0; k < drawn_.size(); ++k)
    load(GL_ARRAY_BUFFER, drawn_[k].instances.id(), parts_.kinds()[k].instances, GL_STREAM_DRAW);
  return parts_.recess();
}

void MechanismLayer::draw(Pass pass, bool translucent) const {
  if (drawn_.empty()) return;
  glUseProgram(pass == Pass::kShadow ? shadow_.id() : colour_.id());
  for (std::size_t k = 0; k < drawn_.size(); ++k) {
    const InstancedMesh& kind = parts_.kinds()[k];
    if (kind.translucent != translucent || kind.instances.empty()) continue;
    glBindVertexArray(drawn_[k].array.id());
    glDrawElementsInstanced(GL_TRIANGLES, static_cast<GLsizei>(kind.mesh.triangles.size()), GL_UNSIGNED_INT,
                            nullptr, static_cast<GLsizei>(kind.instances.size()));
  }
}

}  // namespace smartsurf::view
