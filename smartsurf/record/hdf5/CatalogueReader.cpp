#include "smartsurf/record/hdf5/CatalogueReader.h"

#include <algorithm>

#include "smartsurf/record/hdf5/CatalogueWriter.h"
#include "smartsurf/record/hdf5/Hdf5Reading.h"
#include "smartsurf/record/hdf5/Names.h"
#include "smartsurf/record/hdf5/SolidStorage.h"

namespace smartsurf::record {
namespace {

namespace column = paths::column;

// The columns of /objects, one entry per object.
struct CatalogueColumns {
  explicit CatalogueColumns(hid_t group);
  hsize_t complete_entries(hid_t group) const;
  std::vector<double> read_numbers(hid_t group, const char* name, hsize_t width) const {
    return read_column<double>(group, name, count, width);
  }
  static Eigen::Vector3d vector_at(const std::vector<double>& all, std::size_t i) {
    return {all[3 * i], all[3 * i + 1], all[3 * i + 2]};
  }

  hsize_t count;
  std::vector<std::string> label, shape, material;
  std::vector<std::int32_t> solid;
  std::vector<double> radius, extent, height, mass, fixed, colour, position, orientation, velocity,
      angular_velocity, centre_of_mass;
};

// Returns the length of the shortest column: a killed run may leave columns of different lengths.
hsize_t CatalogueColumns::complete_entries(hid_t group) const {
  hsize_t n = stored_entries(open_dataset(group, column::kId, 1), sizeof(std::uint32_t));
  for (const char* name : {column::kLabel, column::kShape, column::kMaterial})
    n = std::min(n, extents(open_dataset(group, name, 1))[0]);
  return n;
}

CatalogueColumns::CatalogueColumns(hid_t group)
    : count(complete_entries(group)),
      label(read_strings(group, column::kLabel, count)),
      shape(read_strings(group, column::kShape, count)),
      material(read_strings(group, column::kMaterial, count)),
      solid(count, -1),
      radius(read_numbers(group, column::kRadius, 1)),
      extent(read_numbers(group, column::kExtents, 3)),
      height(count),
      mass(read_numbers(group, column::kMass, 1)),
      fixed(read_numbers(group, column::kFixed, 1)),
      colour(read_numbers(group, column::kColour, 3)),
      position(read_numbers(group, column::kInitialPosition, 3)),
      orientation(read_numbers(group, column::kInitialOrientation, 4)),
      velocity(read_numbers(group, column::kInitialVelocity, 3)),
      angular_velocity(read_numbers(group, column::kInitialAngularVelocity, 3)),
      centre_of_mass(3 * count) {
  if (has_link(group, column::kCentreOfMass)) centre_of_mass = read_numbers(group, column::kCentreOfMass, 3);
  if (has_link(group, column::kHeight)) {
    height = read_numbers(group, column::kHeight, 1);
    solid = read_column<std::int32_t>(group, column::kSolid, count);
  } else {  // older recordings have no shapes with a height or a solid of their own
    for (hsize_t i = 0; i < count; ++i) height[i] = extent[3 * i + 2];
  }
}

scene::ObjectSpec make_object(const CatalogueColumns& columns, std::size_t i,
                              const std::vector<std::shared_ptr<const scene::Solid>>& solids) {
  scene::ObjectSpec object;
  if (!parse_shape(columns.shape[i], object.shape))
    throw Hdf5Error("object shape '" + columns.shape[i] + "' is unknown");
  object.size = CatalogueColumns::vector_at(columns.extent, i);
  object.height = columns.height[i];
  if (object.shape != scene::ShapeKind::kBox) object.radius = columns.radius[i];
  if (object.shape == scene::ShapeKind::kSolid) {
    if (columns.solid[i] < 0 || columns.solid[i] >= std::ssize(solids))
      throw Hdf5Error("object " + std::to_string(i) + " refers to a solid that is not in the file");
    object.solid = solids[columns.solid[i]];
  }
  object.label = columns.label[i];
  object.mass = columns.mass[i];
  object.fixed = columns.fixed[i] != 0.0;
  const Eigen::Vector3d colour = CatalogueColumns::vector_at(columns.colour, i);
  object.colour = {static_cast<float>(colour.x()), static_cast<float>(colour.y()),
                   static_cast<float>(colour.z())};
  object.position = CatalogueColumns::vector_at(columns.position, i);
  const double* q = &columns.orientation[4 * i];
  object.orientation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
  object.velocity = CatalogueColumns::vector_at(columns.velocity, i);
  object.angular_velocity = CatalogueColumns::vector_at(columns.angular_velocity, i);
  object.centre_of_mass = CatalogueColumns::vector_at(columns.centre_of_mass, i);
  return object;
}

int find_or_add_material(const std::string& name, std::vector<scene::Material>& materials) {
  const auto found = std::find_if(materials.begin(), materials.end(),
                                  [&](const scene::Material& m) { return m.name == name; });
  const auto index = found - materials.begin();
  if (found == materials.end()) materials.push_back({.name = name});
  return static_cast<int>(index);
}

// The looks of materials by name; recordings of plain materials have none.
void read_looks(hid_t file, std::vector<scene::Material>& materials) {
  const Handle meta = open_group(file, paths::kMeta);
  if (!has_link(meta, paths::kLooks)) return;
  for (const NamedText& entry : read_string_attributes(meta, paths::kLooks)) {
    const auto look = std::ranges::find(scene::kLookNames, std::string_view(entry.value));
    const auto material = std::ranges::find(materials, entry.name, &scene::Material::name);
    if (look != scene::kLookNames.end() && material != materials.end())
      material->look = static_cast<int>(look - scene::kLookNames.begin());
  }
}

}  // namespace

void read_catalogue(hid_t file, scene::SceneSpec& spec) {
  const CatalogueColumns columns(open_group(file, paths::kObjects));
  const auto solids = read_solids(file);
  for (std::size_t i = 0; i < columns.count; ++i) {
    scene::ObjectSpec& object = spec.objects.emplace_back(make_object(columns, i, solids));
    object.material = find_or_add_material(columns.material[i], spec.materials);
    if (const std::string problem = scene::validate(object); !problem.empty())
      throw Hdf5Error("object " + std::to_string(i) + ": " + problem);
  }
  read_looks(file, spec.materials);
}

}  // namespace smartsurf::record
