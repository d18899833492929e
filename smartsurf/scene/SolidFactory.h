// Creates solids from files or points. The script's interface to smartsurf/mesh.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::scene {

struct MeshRequest {
  std::filesystem::path file;  // where it is
  std::string display_name;    // what messages call it
  double scale = 1.0;          // the file's unit, in u
  bool decompose = true;       // into convex pieces; otherwise its convex hull collides
  int max_hulls = 32;          // at most
  double tolerance = 0.2;      // the pieces' volume and inertia may differ from the mesh's by this share
};

struct SolidResult {
  std::shared_ptr<const Solid> solid;  // never null; the same for the same request
  // What its author should know, one line each: what was mended, how far the pieces are from the mesh. Only
  // with the first answer to a request.
  std::vector<std::string> warnings;
};

// Each function throws InputError with one clause that names the file, without the script's place, when no
// solid can be made. Not thread-safe.
class SolidFactory {
 public:
  virtual ~SolidFactory() = default;
  virtual SolidResult load_mesh(const MeshRequest&) = 0;
  // The convex hull of a file's vertices; `decompose`, `pieces` and `tolerance` do not matter.
  virtual SolidResult make_hull(const MeshRequest&) = 0;
  // The convex hull of points, u. `name` stands in messages.
  virtual SolidResult make_hull(std::span<const Eigen::Vector3d> points, const std::string& name) = 0;
};

}  // namespace smartsurf::scene
