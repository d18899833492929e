// A mesh in a base and an accent colour.
#pragma once

#include <cstdint>
#include <vector>

namespace smartsurf::view {

struct TwoColourMesh {
  std::vector<float> vertices;         // 7 per vertex: position, normal, share of the accent colour (0 … 1)
  std::vector<std::uint32_t> indices;  // 3 per triangle
};

}  // namespace smartsurf::view
