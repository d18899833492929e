// A pin as a mesh: an upright prism with rounded edges, whose top is at z = 0.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace smartsurf::view {

struct PinMesh {
  struct Vertex {
    Eigen::Vector3f place, normal;  // u, in the pin's frame
    bool foot;                      // its z is the ground's
  };
  std::vector<Vertex> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;

  PinMesh() = default;
  // half_x, half_y: half edges of the top, u. segments: of a rounded edge.
  PinMesh(float half_x, float half_y, int segments);
};

}  // namespace smartsurf::view
