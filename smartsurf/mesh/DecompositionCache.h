// Keeps decompositions of meshes in files, so that a mesh is decomposed once. Nothing depends on them: what is
// missing, damaged or cannot be written is computed anew, with the same bits.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/mesh/ConvexDecomposition.h"
#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

// Raise it when decompose_convex() gives other parts: files of another version are not read.
inline constexpr std::uint32_t kDecompositionVersion = 1;

class DecompositionCache {
 public:
  using Parts = std::vector<std::vector<Eigen::Vector3d>>;

  // Without a folder ("") nothing is kept. The oldest files are removed while all together exceed `max_bytes`;
  // a decomposition above a quarter of that is not kept.
  explicit DecompositionCache(std::filesystem::path folder,
                              std::uintmax_t max_bytes = std::uintmax_t{256} << 20);

  // As decompose_convex().
  Parts decompose(const TriangleMesh&, const DecompositionLimits&) const;

 private:
  std::optional<Parts> read(const std::filesystem::path&, const std::string& key, const TriangleMesh&,
                            const DecompositionLimits&) const;
  void write(const std::filesystem::path&, const std::string& key, const Parts&) const;

  std::filesystem::path folder_;
  std::uintmax_t max_bytes_;
};

// The user's folder of decompositions, created if it is missing: that of the environment variable
// SMARTSURF_MESH_CACHE, else $XDG_CACHE_HOME/smartsurf/meshes, below ~/.cache without that variable. Empty if
// SMARTSURF_MESH_CACHE is "off", if there is no home, and if the folder is another user's or writable by others.
std::filesystem::path decomposition_folder();

}  // namespace smartsurf::mesh
