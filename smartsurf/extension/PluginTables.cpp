#include "smartsurf/extension/PluginTables.h"

#include <limits>

namespace smartsurf::extension {

static_assert(static_cast<int>(scene::ShapeKind::kSolid) == SMARTSURF_SOLID);
constexpr std::uint64_t kMaxSavedBytes = std::uint64_t{1} << 30;

void require_created(const void* instance, const std::string& type, const Message& message) {
  if (instance == nullptr)
    throw common::UserError(type + ": cannot be created: " +
                            (text_of(message).empty() ? "create() returns null" : text_of(message)));
}

std::vector<smartsurf_plugin_value> values_of(std::span<const scene::Parameter> parameters,
                                              const scene::ParameterValues& values) {
  std::vector<smartsurf_plugin_value> all;
  for (const scene::Parameter& parameter : parameters) {
    std::array<double, 3> numbers{std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0};
    if (const auto found = values.find(parameter.name); found != values.end())
      std::ranges::copy_n(found->second.begin(), std::min(std::ssize(found->second), std::ssize(numbers)),
                          numbers.begin());
    all.push_back({numbers[0], numbers[1], numbers[2]});
  }
  return all;
}

PluginSurface::PluginSurface(const surface::Field& field) {
  for (int i = 0; i < field.cells(); ++i) {
    x_.push_back(field.centre(i).x());
    y_.push_back(field.centre(i).y());
    angle_.push_back(field.angle_of(i));
  }
  surface_ = {.size = sizeof surface_,
              .rows = static_cast<std::uint32_t>(field.rows),
              .columns = static_cast<std::uint32_t>(field.columns),
              .pitch = field.pitch,
              .top_x = 2.0F * field.half_top_x,
              .top_y = 2.0F * field.half_top_y,
              .x = x_.data(),
              .y = y_.data(),
              .angle = angle_.data()};
}

void ObjectTable::describe(std::span<const scene::ObjectSpec> catalogue, smartsurf_plugin_objects& objects) {
  if (catalogue.data() != catalogue_.data() || catalogue.size() != catalogue_.size()) {
    catalogue_ = catalogue;
    shape_.clear(), dimensions_.clear(), colour_.clear(), magnetism_.clear(), label_.clear();
    const auto append = [](std::vector<float>& to, const auto&... numbers) {
      (to.push_back(static_cast<float>(numbers)), ...);
    };
    for (const scene::ObjectSpec& object : catalogue) {
      shape_.push_back(static_cast<std::uint32_t>(object.shape));
      label_.push_back(object.label.c_str());
      append(colour_, object.colour.r, object.colour.g, object.colour.b);
      const Eigen::Vector3d& moment = object.magnetic_moment;
      append(magnetism_, object.magnetic_pole, moment.x(), moment.y(), moment.z());
      const Eigen::Vector3d edges = 2.0 * object.half_extents();
      if (object.shape == scene::ShapeKind::kBox || object.shape == scene::ShapeKind::kSolid)
        append(dimensions_, edges.x(), edges.y(), edges.z());
      else
        append(dimensions_, object.radius, object.shape == scene::ShapeKind::kSphere ? 0.0 : object.height,
               0.0);
    }
  }
  objects.catalogue_count = static_cast<std::uint32_t>(catalogue.size());
  objects.shape = shape_.data();
  objects.dimensions = dimensions_.data();
  objects.colour = colour_.data();
  objects.magnetism = magnetism_.data();
  objects.label = label_.data();
}

void archive_instance(common::StateArchive& a, const std::string& subject, void* instance,
                      std::uint64_t (*save)(void*, void*, std::uint64_t),
                      int (*restore)(void*, const void*, std::uint64_t)) {
  std::string bytes;
  if (a.saves()) {
    const std::uint64_t size = save(instance, nullptr, 0);
    if (size > kMaxSavedBytes)
      throw common::UserError(subject + ": save() returns " + std::to_string(size) +
                              " bytes: must be at most " + std::to_string(kMaxSavedBytes));
    bytes.resize(size);
    if (const std::uint64_t saved = save(instance, bytes.data(), size); saved != size)
      throw common::UserError(subject + ": save() returns " + std::to_string(saved) + " bytes, but first " +
                              std::to_string(size));
  }
  a(bytes);
  if (!a.saves() && restore(instance, bytes.data(), bytes.size()) != 0)
    throw common::UserError(subject + ": the saved state is not one of this extension");
}

}  // namespace smartsurf::extension
