// Makes the solids that scripts ask for, each once: the same file and options, or the same points, share one.
#pragma once

#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "smartsurf/scene/SolidSource.h"

namespace smartsurf::mesh {

class SolidLibrary final : public scene::SolidSource {
 public:
  scene::SolidAnswer mesh(const scene::MeshRequest&) override;
  scene::SolidAnswer hull(const scene::MeshRequest&) override;
  scene::SolidAnswer hull(std::span<const Eigen::Vector3d> points, const std::string& name) override;

 private:
  // File, whether its hull is meant, scale, decompose, pieces, tolerance.
  using FileKey = std::tuple<std::string, bool, double, bool, int, double>;
  std::map<FileKey, std::shared_ptr<const scene::Solid>> of_files_;
  std::map<std::vector<double>, std::shared_ptr<const scene::Solid>> of_points_;
};

}  // namespace smartsurf::mesh
