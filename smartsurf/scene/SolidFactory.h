// The interface through which scripts create solids from files or points. smartsurf/mesh implements it.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::scene {

struct MeshRequest {
  std::filesystem::path file;
  std::string display_name;  // the file's name in messages
  double scale = 1.0;        // u per unit of the file
  bool decompose = true;     // false = collide with the convex hull of the mesh
  // Limit of the decomposition; nullopt: 32, or kMaxHulls for a hollow mesh that 32 exceed by more than a
  // tenth.
  std::optional<int> max_hulls = {};
  double tolerance = 0.2;  // allowed relative deviation of the hulls' volume and inertia from the mesh's
};

struct SolidResult {
  std::shared_ptr<const Solid> solid;  // not null; cached, so equal requests share one solid
  // Warnings for the author of the experiment, one line each: repairs, poor decompositions. Empty when the
  // solid comes from the cache.
  std::vector<std::string> warnings;
};

// All functions throw InputError, with one clause that names the file but not the script's location, if the
// solid cannot be created. Not thread-safe.
class SolidFactory {
 public:
  virtual ~SolidFactory() = default;
  virtual SolidResult load_mesh(const MeshRequest&) = 0;
  // The convex hull of a file's vertices. Ignores `decompose`, `max_hulls` and `tolerance`.
  virtual SolidResult make_hull(const MeshRequest&) = 0;
  // The convex hull of points, u. `name` is used in messages.
  virtual SolidResult make_hull(std::span<const Eigen::Vector3d> points, const std::string& name) = 0;
  // The union of the convex hulls of parts, u; where they overlap, volume and inertia count twice. Not
  // cached.
  virtual SolidResult make_compound(std::span<const std::vector<Eigen::Vector3d>> parts,
                                    const std::string& name) = 0;
};

}  // namespace smartsurf::scene
