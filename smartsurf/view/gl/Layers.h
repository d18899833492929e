// The layers of a picture, each drawn with one call per kind of item. Internal to this module; an OpenGL
// context must be current wherever one is created, used or destroyed.
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

// All pins of the surface: one draw call of plain triangles, whose corners fetch their pin's record. As
// instances of one pin they would cost a software driver a call a pin.
class PinLayer {
 public:
  PinLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass);
  // pins: valid until the last draw() of the frame.
  void upload(std::span<const PinInstance> pins);
  // Every gap between pins is open.
  void draw(RenderPass pass) const;
  // Seen from afar, where a gap is a pixel or three wide: gaps between pins of one level are painted on their
  // tops, and sides that are hidden then are left out. from: x and y of the eye; or, where all rays run one
  // way, against them.
  struct EyePosition {
    Eigen::Vector2f xy;
    bool at_infinity;
  };
  void draw_closed_gaps(RenderPass pass, const EyePosition& eye);
  // Whether draw_closed() is there: for a driver that works on the processor, on a grid of straight rows.
  bool can_close_gaps() const { return closed_colour_.id() != 0; }

 private:
  void draw(const ShaderProgram& program, GLuint triangles, GLsizei indices) const;

  std::array<float, 4> pin_size_;
  float ground_z_, max_side_depth_, level_tolerance_;
  std::span<const PinInstance> pins_;
  VertexArray vertex_array_;
  Buffer index_buffer_, pin_buffer_, visible_index_buffer_;
  std::vector<GLuint> visible_indices_;
  Texture pin_texture_;  // the records, as shaders see them
  ShaderProgram shadow_, colour_, closed_shadow_, closed_colour_;
};

struct ObjectInstance {
  std::array<float, 3> centre;
  std::array<float, 3> half_extent;  // sphere: the radius three times; cylinder: radius, radius, half height
  std::array<float, 4> orientation;  // x y z w
  std::array<float, 4> colour;       // linear light; [3]: z of the pins around the object, u
};

// The objects: one draw call a shape, and one a solid. A frame is begin(), add() for each, upload(), then
// draws.
class ObjectLayer {
 public:
  explicit ObjectLayer(RenderPass colour_pass);
  void clear_instances();
  void add(const scene::ObjectSpec& object, ObjectInstance instance);
  void add_box(const ObjectInstance& instance);  // furniture: before all objects
  void upload();
  void draw(RenderPass pass) const;
  // Of the boxes, the first `solid_boxes` stay solid in a wireframe: the table and the axes.
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

  Programs sphere_, mesh_, capsule_;
  std::array<ShapeBatch, 5> batches_;  // by ShapeKind, but for solids
  std::vector<std::pair<std::shared_ptr<const scene::Solid>, ShapeBatch>>
      solid_batches_;  // in the order of their first use
};

// What stands on the cells of mechanisms other than pins: one draw call a kind of part.
class ActuatorLayer {
 public:
  ActuatorLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass);
  // Returns ActuatorGeometry::recess().
  std::span<const float> upload(const scene::Snapshot& snapshot);
  void draw(RenderPass pass, bool translucent) const;

 private:
  struct MeshBuffers {
    VertexArray vertex_array;
    Buffer vertex_buffer, index_buffer, instance_buffer;
  };
  ActuatorGeometry geometry_;
  std::vector<MeshBuffers> buffers_;  // as parts_.kinds()
  ShaderProgram shadow_, colour_;
};

// Lines of one width: one draw call.
class LineLayer {
 public:
  LineLayer();
  void upload(std::span<const Line> lines);
  // width: in pixels of the picture of that size.
  void draw(float width, int viewport_width, int viewport_height) const;

 private:
  VertexArray vertex_array_;
  Buffer instance_buffer_;
  ShaderProgram program_;
  GLsizei line_count_ = 0;
};

// The ground with its grid, and what is behind everything.
class GroundLayer {
 public:
  GroundLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass);
  // shade: around all shadows on the ground, x and y.
  void draw_ground(bool grid, const Eigen::AlignedBox2d& shadow_area) const;
  void draw_backdrop() const;

 private:
  void draw_section(const ShaderProgram& program, bool grid, const Eigen::AlignedBox2d& shaded_area,
                    int first, int count) const;

  Eigen::AlignedBox2d occluded_area_;  // the table, and around it the ground that sees less of the sky
  float ground_z_, half_extent_, grid_spacing_;
  VertexArray vertex_array_;
  Buffer vertex_buffer_, index_buffer_;
  ShaderProgram shadowed_program_, backdrop_program_;
  ShaderProgram unshadowed_program_;  // without shadows, beyond their reach: only where pixels are dear
};

}  // namespace smartsurf::view
