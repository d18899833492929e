// The three kinds of things that a picture consists of, each drawn by one call a kind. Internal to the room; an
// OpenGL context must be current wherever one of these is made, used or destroyed.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "smartsurf/view/GlObjects.h"
#include "smartsurf/view/PinShading.h"
#include "smartsurf/view/Shaders.h"

namespace smartsurf::view {

// All pins of the surface: one draw call.
class PinLayer {
 public:
  PinLayer(const scene::SurfaceSpec& surface, Pass colour_pass);
  void upload(std::span<const PinInstance> pins, bool north_first, bool east_first);
  void draw(Pass pass) const;

 private:
  std::array<float, 4> pin_;
  float base_;
  std::array<GLint, 4> grid_;
  VertexArray array_;
  Buffer corners_, triangles_, instances_;
  ShaderProgram shadow_, colour_;
};

struct ObjectInstance {
  std::array<float, 3> centre;
  std::array<float, 3> half_extent;  // sphere: the radius three times; cylinder: radius, radius, half height
  std::array<float, 4> orientation;  // x y z w
  std::array<float, 4> colour;       // linear light; [3]: z of the pins around the object, u
};

// The objects: one draw call a shape.
class ObjectLayer {
 public:
  explicit ObjectLayer(Pass colour_pass);
  void upload(scene::ShapeKind shape, std::span<const ObjectInstance> instances);
  void draw(Pass pass) const;
  // Of the boxes, the first `solid_boxes` stay solid in a wireframe: the table and the axes.
  void draw_solid_boxes(Pass pass, GLsizei solid_boxes) const;
  void draw_wires(float line_width, GLsizei solid_boxes) const;

 private:
  struct Kind {
    VertexArray array, wire_array;
    Buffer mesh, triangles, wire, instances;
    GLsizei indices = 0, wire_vertices = 0, count = 0;
    ShaderProgram shadow, colour;
  };
  void set_up(Kind& kind, int floats_a_corner, const std::vector<float>& mesh,
              const std::vector<GLushort>& triangles, const std::vector<float>& wire);

  std::array<Kind, 3> kinds_;  // by ShapeKind
  ShaderProgram wires_;
};

// The ground with its grid, and what is behind everything.
class GroundLayer {
 public:
  GroundLayer(const scene::SurfaceSpec& surface, Pass colour_pass);
  void draw_ground(bool grid) const;
  void draw_backdrop() const;

 private:
  float base_, reach_, spacing_;
  VertexArray array_;
  Buffer corners_;
  ShaderProgram ground_, backdrop_;
};

}  // namespace smartsurf::view
