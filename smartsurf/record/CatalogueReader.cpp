#include "smartsurf/record/CatalogueReader.h"

#include <algorithm>

#include "smartsurf/record/CatalogueWriter.h"
#include "smartsurf/record/Hdf5Reading.h"
#include "smartsurf/record/Solids.h"

namespace smartsurf::record {
namespace {

// The columns of /objects, one entry an object.
struct Catalogue {
  explicit Catalogue(hid_t group);
  hsize_t entries(hid_t group) const;
  std::vector<double> numbers(hid_t group, const char* name, hsize_t width) const {
    return read_column<double>(group, name, H5T_NATIVE_DOUBLE, count, width);
  }
  static Eigen::Vector3d vector(const std::vector<double>& all, std::size_t i) {
    return {all[3 * i], all[3 * i + 1], all[3 * i + 2]};
  }

  hsize_t count;
  std::vector<std::string> label, shape, material;
  std::vector<std::int32_t> solid;
  std::vector<double> radius, extent, height, mass, fixed, colour, position, orientation, velocity, spin;
};

// A killed run may have got only so far with some of them.
hsize_t Catalogue::entries(hid_t group) const {
  hsize_t n = stored_entries(open_dataset(group, "id", 1), sizeof(std::uint32_t));
  for (const char* name : {"label", "shape", "material"})
    n = std::min(n, extents(open_dataset(group, name, 1))[0]);
  return n;
}

Catalogue::Catalogue(hid_t group)
    : count(entries(group)),
      label(read_texts(group, "label", count)),
      shape(read_texts(group, "shape", count)),
      material(read_texts(group, "material", count)),
      solid(count, -1),
      radius(numbers(group, "radius", 1)),
      extent(numbers(group, "extents", 3)),
      height(count),
      mass(numbers(group, "mass", 1)),
      fixed(numbers(group, "fixed", 1)),
      colour(numbers(group, "colour", 3)),
      position(numbers(group, "initial_position", 3)),
      orientation(numbers(group, "initial_orientation", 4)),
      velocity(numbers(group, "initial_velocity", 3)),
      spin(numbers(group, "initial_angular_velocity", 3)) {
  if (has_link(group, "height")) {
    height = numbers(group, "height", 1);
    solid = read_column<std::int32_t>(group, "solid", H5T_NATIVE_INT32, count);
  } else {  // older recordings know no shapes that have a height or a solid of their own
    for (hsize_t i = 0; i < count; ++i) height[i] = extent[3 * i + 2];
  }
}

scene::ObjectSpec object_of(const Catalogue& all, std::size_t i,
                            const std::vector<std::shared_ptr<const scene::Solid>>& solids) {
  scene::ObjectSpec object;
  if (!shape_of(all.shape[i], object.shape))
    throw Hdf5Error("object shape '" + all.shape[i] + "' is unknown");
  object.size = Catalogue::vector(all.extent, i);
  object.height = all.height[i];
  if (object.shape != scene::ShapeKind::kBox) object.radius = all.radius[i];
  if (object.shape == scene::ShapeKind::kSolid) {
    if (all.solid[i] < 0 || static_cast<std::size_t>(all.solid[i]) >= solids.size())
      throw Hdf5Error("object " + std::to_string(i) + " is a solid that is not in the file");
    object.solid = solids[static_cast<std::size_t>(all.solid[i])];
  }
  object.label = all.label[i];
  object.mass = all.mass[i];
  object.fixed = all.fixed[i] != 0.0;
  const Eigen::Vector3d colour = Catalogue::vector(all.colour, i);
  object.colour = {static_cast<float>(colour.x()), static_cast<float>(colour.y()),
                   static_cast<float>(colour.z())};
  object.position = Catalogue::vector(all.position, i);
  const double* q = &all.orientation[4 * i];
  object.orientation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
  object.velocity = Catalogue::vector(all.velocity, i);
  object.angular_velocity = Catalogue::vector(all.spin, i);
  return object;
}

int material_of(const std::string& name, std::vector<scene::Material>& materials) {
  const auto known = std::find_if(materials.begin(), materials.end(),
                                  [&](const scene::Material& m) { return m.name == name; });
  const auto number = known - materials.begin();
  if (known == materials.end()) materials.push_back({.name = name});
  return static_cast<int>(number);
}

}  // namespace

void read_catalogue(hid_t file, scene::SceneSpec& spec) {
  const Catalogue all(open_group(file, "objects"));
  const auto solids = read_solids(file);
  for (std::size_t i = 0; i < all.count; ++i) {
    scene::ObjectSpec& object = spec.objects.emplace_back(object_of(all, i, solids));
    object.material = material_of(all.material[i], spec.materials);
    if (const std::string problem = scene::problem_with(object); !problem.empty())
      throw Hdf5Error("object " + std::to_string(i) + ": " + problem);
  }
}

}  // namespace smartsurf::record
