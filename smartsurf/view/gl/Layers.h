// The kinds of things that a picture consists of, each drawn by one call a kind. Internal to the room;
// an OpenGL context must be current wherever one of these is made, used or destroyed.
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
  PinLayer(const scene::SurfaceSpec& surface, Pass colour_pass);
  // pins: valid until the last draw() of the frame.
  void upload(std::span<const PinInstance> pins);
  // Every gap between pins is open.
  void draw(Pass pass) const;
  // Seen from afar, where a gap is a pixel or three wide: gaps between pins of one level are painted on their
  // tops, and sides that are hidden then are left out. from: x and y of the eye; or, where all rays run one
  // way, against them.
  struct Sight {
    Eigen::Vector2f from;
    bool parallel;
  };
  void draw_closed(Pass pass, const Sight& sight);
  // Whether draw_closed() is there: for a driver that works on the processor, on a grid of straight rows.
  bool can_close() const { return closed_colour_.id() != 0; }

 private:
  void draw(const ShaderProgram& program, GLuint triangles, GLsizei indices) const;

  std::array<float, 4> pin_;
  float base_, sunk_, level_;
  std::span<const PinInstance> pins_;
  VertexArray array_;
  Buffer triangles_, records_, seen_triangles_;
  std::vector<GLuint> seen_;
  Texture texture_;  // the records, as shaders see them
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
  explicit ObjectLayer(Pass colour_pass);
  void begin();
  void add(const scene::ObjectSpec& object, ObjectInstance instance);
  void add_box(const ObjectInstance& instance);  // furniture: before all objects
  void upload();
  void draw(Pass pass) const;
  // Of the boxes, the first `solid_boxes` stay solid in a wireframe: the table and the axes.
  void draw_solid_boxes(Pass pass, GLsizei solid_boxes) const;
  void draw_wires(float line_width, GLsizei solid_boxes) const;

 private:
  struct Programs {
    ShaderProgram shadow, colour, wires;
    void link(const char* name, const ShaderSources& shadow_source, const ShaderSources& colour_source,
              const ShaderSources& wire_source);
  };
  struct Kind {
    const Programs* programs = nullptr;
    VertexArray array, wire_array;
    Buffer mesh, triangles, wire, instances;
    GLsizei indices = 0, wire_vertices = 0, count = 0;
    std::vector<ObjectInstance> list;
  };
  void set_up(Kind& kind, const Programs& programs, int floats_a_corner, const std::vector<float>& mesh,
              const std::vector<std::uint32_t>& triangles, const std::vector<float>& wire);
  template <class Action>
  void for_each_kind(Action action) const;

  Programs sphere_, mesh_, capsule_;
  std::array<Kind, 5> kinds_;  // by ShapeKind, but for solids
  std::vector<std::pair<std::shared_ptr<const scene::Solid>, Kind>>
      solids_;  // in the order of their first use
};

// What stands on the cells of mechanisms other than pins: one draw call a kind of part.
class MechanismLayer {
 public:
  MechanismLayer(const scene::SurfaceSpec& surface, Pass colour_pass);
  // Returns MechanismParts::recess().
  std::span<const float> upload(const scene::Snapshot& snapshot);
  void draw(Pass pass, bool translucent) const;

 private:
  struct Drawn {
    VertexArray array;
    Buffer corners, triangles, instances;
  };
  ActuatorGeometry parts_;
  std::vector<Drawn> drawn_;  // as parts_.kinds()
  ShaderProgram shadow_, colour_;
};

// Lines of one width: one draw call.
class LineLayer {
 public:
  LineLayer();
  void upload(std::span<const Line> lines);
  // width: in pixels of the picture of that size.
  void draw(float width, int picture_width, int picture_height) const;

 private:
  VertexArray array_;
  Buffer lines_;
  ShaderProgram program_;
  GLsizei count_ = 0;
};

// The ground with its grid, and what is behind everything.
class GroundLayer {
 public:
  GroundLayer(const scene::SurfaceSpec& surface, Pass colour_pass);
  // shade: around all shadows on the ground, x and y.
  void draw_ground(bool grid, const Eigen::AlignedBox2d& shade) const;
  void draw_backdrop() const;

 private:
  void draw_section(const ShaderProgram& program, bool grid, const Eigen::AlignedBox2d& shaded, int first,
                    int count) const;

  Eigen::AlignedBox2d dim_;  // the table, and around it the ground that sees less of the sky
  float base_, reach_, spacing_;
  VertexArray array_;
  Buffer corners_, triangles_;
  ShaderProgram shaded_, backdrop_;
  ShaderProgram sunlit_;  // without shadows, beyond their reach: only where pixels are dear
};

}  // namespace smartsurf::view
