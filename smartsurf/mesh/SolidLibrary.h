// Creates and caches the solids that scripts request: equal files and options, or equal points, share one
// solid.
#pragma once

#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "smartsurf/scene/SolidFactory.h"

namespace smartsurf::mesh {

class SolidLibrary final : public scene::SolidFactory {
 public:
  scene::SolidResult load_mesh(const scene::MeshRequest&) override;
  scene::SolidResult make_hull(const scene::MeshRequest&) override;
  scene::SolidResult make_hull(std::span<const Eigen::Vector3d> points, const std::string& name) override;

 private:
  // File, whether its hull is meant, scale, decompose, pieces, tolerance.
  using FileKey = std::tuple<std::string, bool, double, bool, int, double>;
  std::map<FileKey, std::shared_ptr<const scene::Solid>> solids_by_file_;
  std::map<std::vector<double>, std::shared_ptr<const scene::Solid>> solids_by_points_;
};

}  // namespace smartsurf::mesh
