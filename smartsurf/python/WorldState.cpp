#include "smartsurf/python/WorldState.h"

#include <cstddef>
#include <utility>

#include "common/error/UserError.h"

namespace smartsurf::python {

namespace {

void require_alive(bool alive, std::uint32_t id) {
  if (!alive) throw common::UserError("object " + std::to_string(id) + " is not alive");
}

}  // namespace

py::tuple parameter(const Environment& environment, const std::string& name) {
  const simulation::SceneParameter found = environment.find_parameter(name);
  return py::make_tuple(found.shape(), environment.parameter(found), found.is_whole(), found.is_per_cell());
}

void set_parameter(Environment& environment, const std::string& name, std::span<const double> values) {
  const simulation::SceneParameter found = environment.find_parameter(name);
  if (values.size() != found.size())
    throw common::UserError("parameter '" + name + "' has " + std::to_string(found.size()) +
                            " numbers in this world");
  environment.set_parameter(found, values);
}

void randomise(Environment& environment, const std::string& name, std::span<const double> low,
               std::span<const double> high) {
  const simulation::SceneParameter found = environment.find_parameter(name);
  if (!low.empty() && low.size() != found.size())
    throw common::UserError("parameter '" + name + "' has " + std::to_string(found.size()) +
                            " numbers in this world");
  environment.randomise(found, low, high);
}

ParameterSettings parameter_settings(const Environment& environment) {
  auto [values, ranges] = environment.parameter_settings();
  ParameterSettings out{std::move(values), {}};
  for (auto& [name, low, high] : ranges)
    out.second.emplace_back(std::move(name), std::move(low), std::move(high));
  return out;
}

void set_parameter_settings(Environment& environment, const ParameterSettings& given) {
  Environment::ParameterSettings settings{given.first, {}};
  for (const auto& [name, low, high] : given.second) settings.ranges.push_back({name, low, high});
  environment.set_parameter_settings(std::move(settings));
}

void place(Environment& environment, const std::string& field, const std::vector<std::uint32_t>& ids,
           std::span<const double> values) {
  const std::size_t size = ids.empty() ? 0 : values.size() / ids.size();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const double* const v = &values[i * size];
    scene::ObjectStateUpdate update;
    if (field == "position")
      update.position = Eigen::Vector3d(v);
    else if (field == "orientation")
      update.orientation = Eigen::Quaterniond(Eigen::Vector4d(v)).normalized();
    else if (field == "velocity")
      update.velocity = Eigen::Vector3d(v);
    else
      update.angular_velocity = Eigen::Vector3d(v);
    require_alive(environment.place(ids[i], update), ids[i]);
  }
}

void set_wrenches(Environment& environment, const std::vector<std::uint32_t>& ids,
                  std::span<const double> values) {
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Eigen::Map<const Eigen::Matrix<double, 6, 1>> v(&values[i * 6]);
    const surface::Wrench wrench{v.head<3>().cast<float>(), v.tail<3>().cast<float>()};
    require_alive(environment.set_wrench(ids[i], wrench), ids[i]);
  }
}

}  // namespace smartsurf::python
