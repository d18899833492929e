// Keeps decompositions of meshes in files, so that a mesh is decomposed once. Nothing depends on them: what
// is missing, damaged or cannot be written is computed again, with the same bits.
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
inline constexpr std::uint32_t kDecompositionVersion = 2;

class DecompositionCache {
 public:
  using Parts = std::vector<std::vector<Eigen::Vector3d>>;

  // Nothing is kept without a folder ("") or in one that is another user's or writable by others; a missing
  // one is created for the first file. The oldest files are removed while all together exceed `max_bytes`; a
  // decomposition above a quarter of that is not kept.
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

// The user's folder of decompositions, which may be missing: that of the environment variable
// SMARTSURF_MESH_CACHE, else $XDG_CACHE_HOME/smartsurf/meshes, below ~/.cache without that variable. Empty if
// SMARTSURF_MESH_CACHE is "off" and if there is no home.
std::filesystem::path decomposition_folder();

// Creates the folder if it is missing, for this user alone. False if that fails, and if the folder is another
// user's or writable by others.
bool create_decomposition_folder(const std::filesystem::path&);

}  // namespace smartsurf::mesh
