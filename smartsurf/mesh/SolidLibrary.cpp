#include "smartsurf/mesh/SolidLibrary.h"

#include <new>

#include "smartsurf/mesh/MakeSolid.h"
#include "smartsurf/mesh/MeshFile.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

// Puts the file's name in front of what `make` says.
template <typename Make>
scene::SolidAnswer answer(const std::string& name, Make make) {
  try {
    std::vector<std::string> notes;
    scene::Solid solid = make(notes);
    solid.source = name;
    for (std::string& note : notes) note = "'" + name + "': " + note;
    return {std::make_shared<const scene::Solid>(std::move(solid)), std::move(notes)};
  } catch (const scene::InputError& e) {
    throw scene::InputError("'" + name + "': " + e.what());
  } catch (const std::bad_alloc&) {
    throw scene::InputError("'" + name + "': is too large for the memory there is");
  }
}

TriangleMesh scaled(TriangleMesh mesh, double scale) {
  for (auto& p : mesh.points) p *= scale;
  return mesh;
}

}  // namespace

scene::SolidAnswer SolidLibrary::mesh(const scene::MeshRequest& r) {
  const FileKey key{r.file.string(), false, r.scale, r.decompose, r.pieces, r.tolerance};
  if (const auto known = of_files_.find(key); known != of_files_.end()) return {known->second, {}};
  scene::SolidAnswer made = answer(r.name, [&](std::vector<std::string>& notes) {
    return solid_of(scaled(read_mesh(r.file), r.scale), {r.decompose, r.pieces, r.tolerance}, notes);
  });
  of_files_.emplace(key, made.solid);
  return made;
}

scene::SolidAnswer SolidLibrary::hull(const scene::MeshRequest& r) {
  const FileKey key{r.file.string(), true, r.scale, false, 0, 0.0};
  if (const auto known = of_files_.find(key); known != of_files_.end()) return {known->second, {}};
  scene::SolidAnswer made = answer(r.name, [&](std::vector<std::string>&) {
    return hull_solid(scaled(read_mesh(r.file), r.scale).points);
  });
  of_files_.emplace(key, made.solid);
  return made;
}

scene::SolidAnswer SolidLibrary::hull(std::span<const Eigen::Vector3d> points, const std::string& name) {
  std::vector<double> key;
  for (const auto& p : points) key.insert(key.end(), p.data(), p.data() + 3);
  if (const auto known = of_points_.find(key); known != of_points_.end()) return {known->second, {}};
  scene::SolidAnswer made = answer(name, [&](std::vector<std::string>&) { return hull_solid(points); });
  of_points_.emplace(std::move(key), made.solid);
  return made;
}

}  // namespace smartsurf::mesh
