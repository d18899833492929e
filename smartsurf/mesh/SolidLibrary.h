// Creates and caches the solids that scripts request. Requests with the same file and options, or the same
// points, share one solid.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "smartsurf/mesh/DecompositionCache.h"
#include "smartsurf/scene/SolidFactory.h"

namespace smartsurf::mesh {

class SolidLibrary final : public scene::SolidFactory {
 public:
  // Decompositions are kept in that folder; "": only here.
  explicit SolidLibrary(const std::filesystem::path& cache_folder = {}) : decompositions_(cache_folder) {}

  scene::SolidResult load_mesh(const scene::MeshRequest&) override;
  scene::SolidResult make_hull(const scene::MeshRequest&) override;
  scene::SolidResult make_hull(std::span<const Eigen::Vector3d> points, const std::string& name) override;
  scene::SolidResult make_compound(std::span<const std::vector<Eigen::Vector3d>> parts,
                                   const std::string& name) override;

 private:
  // File, whether it is a make_hull request, scale, decompose, max_hulls, tolerance.
  using FileKey = std::tuple<std::string, bool, double, bool, int, double>;
  DecompositionCache decompositions_;
  std::map<FileKey, std::shared_ptr<const scene::Solid>> solids_by_file_;
  std::map<std::vector<double>, std::shared_ptr<const scene::Solid>> solids_by_points_;
};

}  // namespace smartsurf::mesh
