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

// The solid that was built for the key before, or that `make` builds now.
template <typename Key, typename Make>
scene::SolidResult cached(std::map<Key, std::shared_ptr<const scene::Solid>>& solids, const Key& key,
                          const std::string& name, Make make) {
  if (const auto known = solids.find(key); known != solids.end()) return {known->second, {}};
  scene::SolidResult made = build(name, make);
  solids.emplace(key, made.solid);
  return made;
}

TriangleMesh read_scaled(const scene::MeshRequest& r) {
  TriangleMesh mesh = read_mesh(r.file);
  for (auto& p : mesh.points) p *= r.scale;
  return mesh;
}

}  // namespace

scene::SolidResult SolidLibrary::load_mesh(const scene::MeshRequest& r) {
  const FileKey key{r.file.string(), false, r.scale, r.decompose, r.max_hulls.value_or(0), r.tolerance};
  return cached(solids_by_file_, key, r.display_name, [&](std::vector<std::string>& notes) {
    const SolidOptions standard;
    return build_solid(read_scaled(r),
                       {.decompose = r.decompose,
                        .max_hulls = r.max_hulls.value_or(standard.max_hulls),
                        .max_hollow_hulls = r.max_hulls.value_or(scene::kMaxHulls),
                        .tolerance = r.tolerance,
                        .cache = &decompositions_},
                       notes);
  });
}

scene::SolidResult SolidLibrary::make_hull(const scene::MeshRequest& r) {
  const FileKey key{r.file.string(), true, r.scale, false, 0, 0.0};
  return cached(solids_by_file_, key, r.display_name,
                [&](std::vector<std::string>&) { return build_hull_solid(read_scaled(r).points); });
}

scene::SolidResult SolidLibrary::make_hull(std::span<const Eigen::Vector3d> points, const std::string& name) {
  std::vector<double> key;
  for (const auto& p : points) key.insert(key.end(), p.data(), p.data() + 3);
  return cached(solids_by_points_, key, name,
                [&](std::vector<std::string>&) { return build_hull_solid(points); });
}

scene::SolidResult SolidLibrary::make_compound(std::span<const std::vector<Eigen::Vector3d>> parts,
                                               const std::string& name) {
  return build(name, [&](std::vector<std::string>&) { return build_compound(parts); });
}

}  // namespace smartsurf::mesh
