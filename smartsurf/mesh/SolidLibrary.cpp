#include "smartsurf/mesh/SolidLibrary.h"

#include <new>

#include "smartsurf/mesh/MeshFile.h"
#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

// Calls `make` and prefixes its notes and errors with `name`.
template <typename Make>
scene::SolidResult build(const std::string& name, Make make) {
  try {
    std::vector<std::string> notes;
    scene::Solid solid = make(notes);
    solid.source = name;
    for (std::string& note : notes) note = "'" + name + "': " + note;
    return {std::make_shared<const scene::Solid>(std::move(solid)), std::move(notes)};
  } catch (const scene::InputError& e) {
    throw scene::InputError("'" + name + "': " + e.what());
  } catch (const std::bad_alloc&) {
    throw scene::InputError("'" + name + "': is too large for the available memory");
  }
}

TriangleMesh scaled(TriangleMesh mesh, double scale) {
  for (auto& p : mesh.points) p *= scale;
  return mesh;
}

}  // namespace

scene::SolidResult SolidLibrary::load_mesh(const scene::MeshRequest& r) {
  const FileKey key{r.file.string(), false, r.scale, r.decompose, r.max_hulls, r.tolerance};
  if (const auto cached = solids_by_file_.find(key); cached != solids_by_file_.end())
    return {cached->second, {}};
  scene::SolidResult made = build(r.display_name, [&](std::vector<std::string>& notes) {
    return build_solid(scaled(read_mesh(r.file), r.scale), {r.decompose, r.max_hulls, r.tolerance}, notes);
  });
  solids_by_file_.emplace(key, made.solid);
  return made;
}

scene::SolidResult SolidLibrary::make_hull(const scene::MeshRequest& r) {
  const FileKey key{r.file.string(), true, r.scale, false, 0, 0.0};
  if (const auto cached = solids_by_file_.find(key); cached != solids_by_file_.end())
    return {cached->second, {}};
  scene::SolidResult made = build(r.display_name, [&](std::vector<std::string>&) {
    return build_hull_solid(scaled(read_mesh(r.file), r.scale).points);
  });
  solids_by_file_.emplace(key, made.solid);
  return made;
}

scene::SolidResult SolidLibrary::make_hull(std::span<const Eigen::Vector3d> points, const std::string& name) {
  std::vector<double> key;
  for (const auto& p : points) key.insert(key.end(), p.data(), p.data() + 3);
  if (const auto cached = solids_by_points_.find(key); cached != solids_by_points_.end())
    return {cached->second, {}};
  scene::SolidResult made = build(name, [&](std::vector<std::string>&) { return build_hull_solid(points); });
  solids_by_points_.emplace(std::move(key), made.solid);
  return made;
}

scene::SolidResult SolidLibrary::make_compound(std::span<const std::vector<Eigen::Vector3d>> parts,
                                               const std::string& name) {
  return build(name, [&](std::vector<std::string>&) { return build_compound(parts); });
}

}  // namespace smartsurf::mesh
