// The layers of a frame, each drawn with one call per kind of item. Internal to smartsurf/view.
//
// The same OpenGL context must be current whenever a layer is created, used or destroyed.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "smartsurf/view/gl/GlObjects.h"
#include "smartsurf/view/gl/Shaders.h"
#include "smartsurf/view/model/ActuatorGeometry.h"
#include "smartsurf/view/model/PinShading.h"

namespace smartsurf::view {

// All pins of the surface in one draw call. The vertex shader fetches each pin's record from a buffer
// texture: a software driver processes instanced draws one instance at a time, which is slower.
class PinLayer {
 public:
  PinLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass);
  // pins must stay valid until the last draw of the frame.
  void upload(std::span<const PinInstance> pins);
  // Draws every gap between pins as geometry.
  void draw(RenderPass pass) const;
  // x and y of the eye, u. For a parallel projection (at_infinity), of the direction towards the eye.
  struct EyePosition {
    Eigen::Vector2f xy;
    bool at_infinity;
  };
  // Draws distant pins, whose gaps are at most a few pixels wide: gaps between level pins are painted on the
  // tops, and the sides hidden by that are skipped.
  void draw_closed_gaps(RenderPass pass, const EyePosition& eye);
  // draw_closed_gaps() exists only for kColourFast and narrow gaps.
  bool can_close_gaps() const { return closed_colour_.id() != 0; }

 private:
  void draw(const ShaderProgram& program, GLuint triangles, GLsizei indices) const;

  std::array<float, 4> pin_size_;
  float ground_z_, max_side_depth_, level_tolerance_;
  bool sealed_;     // the outermost ring closes its gaps, which are narrow
  bool hexagonal_;  // three prisms are a hexagon
  std::span<const PinInstance> pins_;
  VertexArray vertex_array_;
  Buffer index_buffer_, pin_buffer_, visible_index_buffer_;
  std::vector<GLuint> visible_indices_;
  Texture pin_texture_;  // buffer texture over pin_buffer_
  ShaderProgram shadow_, colour_, closed_shadow_, closed_colour_;
};

struct ObjectInstance {
  std::array<float, 3> centre;
  std::array<float, 3> half_extent;  // sphere: the radius three times; cylinder: radius, radius, half height
  std::array<float, 4> orientation;  // x y z w
  std::array<float, 4> colour;       // linear light; [3]: z of the pins around the object, u
  std::array<float, 4> finish;       // as lit_material() in ShaderChunks.cpp takes it
};

// The objects, one draw call per shape and one per solid. Call order within a frame: clear_instances(),
// add_box() for the static boxes, add() per object, upload(), then the draw calls.
class ObjectLayer {
 public:
  explicit ObjectLayer(RenderPass colour_pass);
  void clear_instances();
  void add(const scene::ObjectSpec& object, ObjectInstance instance);
  void add_box(const ObjectInstance& instance);  // a static box; before all objects
  void upload();
  void draw(RenderPass pass) const;
  // The first `static_boxes` boxes (the board and the axes) are drawn solid in wireframe mode too.
  void draw_static_boxes(RenderPass pass, GLsizei static_boxes) const;
  void draw_wireframes(float line_width, GLsizei static_boxes) const;

 private:
  struct Programs {
    ShaderProgram shadow, colour, wireframe;
    void link(const char* name, const ShaderSources& shadow_source, const ShaderSources& colour_source,
              const ShaderSources& wireframe_source);
  };
  struct ShapeBatch {
    const Programs* programs = nullptr;
    VertexArray vertex_array, wireframe_vertex_array;
    Buffer vertex_buffer, index_buffer, wireframe_buffer, instance_buffer;
    GLsizei index_count = 0, wireframe_vertex_count = 0, instance_count = 0;
    std::vector<ObjectInstance> instances;
  };
  void init_batch(ShapeBatch& batch, const Programs& programs, int floats_per_vertex,
                  const std::vector<float>& mesh, const std::vector<std::uint32_t>& triangles,
                  const std::vector<float>& wireframe);
  template <class Action>
  void for_each_batch(Action action) const;
  ShapeBatch& batch_of(scene::ShapeKind shape) { return batches_[static_cast<std::size_t>(shape)]; }

  static constexpr auto kBoxes = static_cast<std::size_t>(scene::ShapeKind::kBox);
  Programs sphere_, mesh_, capsule_;
  std::array<ShapeBatch, 5> batches_;  // indexed by ShapeKind, without kSolid
  // In the order of first use.
  std::vector<std::pair<std::shared_ptr<const scene::Solid>, ShapeBatch>> solid_batches_;
};

// The actuator parts that ActuatorGeometry places on the cells, one draw call per mesh.
class ActuatorLayer {
 public:
  ActuatorLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass);
  // Returns ActuatorGeometry::recess(), or an empty span without meshes.
  std::span<const float> upload(const scene::Snapshot& snapshot);
  void draw(RenderPass pass, bool translucent) const;

 private:
  struct MeshBuffers {
    VertexArray vertex_array;
    Buffer vertex_buffer, index_buffer, instance_buffer;
  };
  ActuatorGeometry geometry_;
  std::vector<MeshBuffers> buffers_;  // one per geometry_.meshes()
  ShaderProgram shadow_, colour_;
};

// Lines of one width in one draw call.
class LineLayer {
 public:
  LineLayer();
  void upload(std::span<const Line> lines);
  // Draws each line with a halo of contrasting brightness, and faintly where it is hidden. width: in pixels
  // of the viewport.
  void draw(float width, int viewport_width, int viewport_height) const;

 private:
  VertexArray vertex_array_;
  Buffer instance_buffer_;
  ShaderProgram program_;
  GLsizei line_count_ = 0;
};

// The ground with its grid, and the backdrop.
class GroundLayer {
 public:
  GroundLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass);
  // shadow_area: x and y bounds of all shadows on the ground, u.
  void draw_ground(bool grid, const Eigen::AlignedBox2d& shadow_area) const;
  void draw_backdrop() const;

 private:
  void draw_section(const ShaderProgram& program, bool grid, const Eigen::AlignedBox2d& shaded_area,
                    int first, int count) const;

  double darkened_;                    // width of the ground around the table that it darkens, u
  Eigen::AlignedBox2d occluded_area_;  // the table and the ground around it that it darkens; x, y, u
  float ground_z_, half_extent_, grid_spacing_;
  VertexArray vertex_array_;
  Buffer vertex_buffer_, index_buffer_;
  ShaderProgram shadowed_program_, backdrop_program_;
  ShaderProgram unshadowed_program_;  // cheaper, for the ground outside shaded areas; kColourFast only
};

}  // namespace smartsurf::view
