#include "smartsurf/simulation/Nuisances.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "common/text/Suggestion.h"
#include "common/text/Words.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/simulation/EpisodeRandom.h"
#include "smartsurf/simulation/SceneParameter.h"

namespace smartsurf::simulation {
namespace {

using scene::SceneSpec;
using scene::Variation;
using Mode = Variation::Mode;

// Short names of parameters. Those of sensors also set what a sensor declares for itself.
struct Alias {
  const char *name, *parameter;
};
constexpr std::array<Alias, 11> kAliases{{{"latency", "faults.actuator.latency"},
                                          {"stuck", "faults.actuator.stuck"},
                                          {"dead", "faults.actuator.dead"},
                                          {"weak", "faults.actuator.weak"},
                                          {"weak_gain", "faults.actuator.weak_gain"},
                                          {"sensor_noise", "faults.sensor.noise"},
                                          {"sensor_dropout", "faults.sensor.dropout"},
                                          {"sensor_latency", "faults.sensor.latency"},
                                          {"sensor_dead", "faults.sensor.dead"},
                                          {"false_hits", "faults.sensor.false_hits"},
                                          {"gravity", "world.gravity"}}};
constexpr std::string_view kSensorFaults = "faults.sensor.";

const MaterialField* find_material_nuisance(const std::string& name) {
  const auto* const found =
      std::ranges::find(kMaterialFields, name, [](const MaterialField& n) { return std::string(n.name); });
  return found == kMaterialFields.end() ? nullptr : found;
}

bool is_of_objects(const Variation& v) { return v.name == "mass" || v.name == "size"; }

[[noreturn]] void refuse(const Variation& v, const std::string& clause) {
  throw scene::InputError(v.subject + ": " + clause);
}

// Runs what throws a clause, and puts the variation before it.
template <class Function>
auto with_subject(const Variation& v, Function function) {
  try {
    return function();
  } catch (const scene::InputError& error) {
    refuse(v, error.what());
  }
}

[[noreturn]] void refuse_unknown(const Variation& v) {
  std::vector<std::string> known{"mass", "size", "pin_speed"};
  for (const MaterialField& n : kMaterialFields) known.emplace_back(n.name);
  for (const Alias& a : kAliases) known.emplace_back(a.name);
  std::ranges::sort(known);
  const std::string meant = common::nearest_name(v.name, known);
  refuse(v, "no nuisance or parameter '" + v.name + "'" +
                (meant.empty() ? "; known: " + common::join(known) : " (did you mean '" + meant + "'?)"));
}

// The parameters that the variation sets, all to or by one number.
std::vector<SceneParameter> parameters_of(const SceneSpec& s, const Variation& v) {
  std::vector<std::string> names;
  if (const auto* const alias =
          std::ranges::find(kAliases, v.name, [](const Alias& a) { return std::string(a.name); });
      alias != kAliases.end()) {
    const std::string parameter = alias->parameter;
    names.push_back(parameter);
    if (parameter.starts_with(kSensorFaults))
      for (const scene::SensorSpec& sensor : s.surface.sensors)
        if (const std::string error = parameter.substr(kSensorFaults.size()); sensor.values.contains(error))
          names.push_back("sensor." + sensor.name + "." + error);
  } else if (v.name == "pin_speed") {
    const auto actuators = s.surface.effective_actuators();
    for (const scene::ActuatorSpec& a : actuators) {
      if (scene::find_actuator_kind(a.model)->find_parameter("max_speed") == nullptr) continue;
      std::string name = actuators.size() > 1 ? "actuator." + a.model + ".max_speed" : "actuator.max_speed";
      if (std::ranges::find(names, name) == names.end()) names.push_back(std::move(name));
    }
    if (names.empty()) refuse(v, "no actuator of the surface has a max_speed");
  } else if (v.name.find('.') == std::string::npos) {
    refuse_unknown(v);
  } else {
    names.push_back(v.name);
  }
  std::vector<SceneParameter> found;
  for (const std::string& name : names) {
    found.push_back(with_subject(v, [&] { return SceneParameter::find(s, name); }));
    const SceneParameter& parameter = found.back();
    if (parameter.is_per_cell()) refuse(v, "is a value of each cell; vary faults.actuator or faults.sensor");
    if (parameter.components() > 1 && v.mode != Mode::kFactor) refuse(v, "is a vector: must be a 'factor'");
    if (parameter.is_whole() && v.mode != Mode::kFactor &&
        (v.low != std::round(v.low) || v.high != std::round(v.high)))
      refuse(v, "must have whole numbers");
  }
  return found;
}

double changed(const Variation& v, double declared, double by) {
  if (v.mode == Mode::kAbsolute) return by;
  return v.mode == Mode::kFactor ? declared * by : declared + by;
}

void set_parameters(SceneSpec& s, const Variation& v, double by) {
  const std::vector<SceneParameter> parameters = parameters_of(s, v);
  bool is_declared = false;
  for (const SceneParameter& parameter : parameters) {
    std::vector<double> numbers(parameter.size());
    parameter.get(s, numbers);
    for (double& number : numbers) {
      number = changed(v, number, by);
      if (parameter.is_whole()) number = std::round(number);
      is_declared |= !std::isnan(number);
    }
    parameter.set(s, numbers);
  }
  if (!is_declared) refuse(v, "the script declares no value for a 'factor' or an 'offset' to change");
  for (const SceneParameter& parameter : parameters) with_subject(v, [&] { parameter.check(s); });
}

void set_material(SceneSpec& s, const Variation& v, double scene::Material::*member, double by) {
  for (scene::Material& material : s.materials) {
    material.*member = changed(v, material.*member, by);
    scene::Material named = material;
    if (named.name.empty()) named.name = "own";
    if (const std::string clause = validate(named); !clause.empty()) refuse(v, clause);
  }
}

void require_valid(const Variation& v, const scene::ObjectSpec& object) {
  if (const std::string clause = validate(object); !clause.empty()) refuse(v, clause);
}

}  // namespace

bool have_same_channels(const SceneSpec& a, const SceneSpec& b) {
  const auto same_actuator = [](const scene::ActuatorChannel& x, const scene::ActuatorChannel& y) {
    return x.name == y.name && x.minimum == y.minimum && x.maximum == y.maximum &&
           x.safe_value == y.safe_value;
  };
  const auto same_sensor = [](const scene::SensorChannel& x, const scene::SensorChannel& y) {
    return x.name == y.name && x.minimum == y.minimum && x.maximum == y.maximum &&
           x.components == y.components;
  };
  return std::ranges::equal(a.surface.actuator_channels(), b.surface.actuator_channels(), same_actuator) &&
         std::ranges::equal(scene::collect_channels(a.surface.sensors),
                            scene::collect_channels(b.surface.sensors), same_sensor);
}

Nuisances::Nuisances(SceneSpec& s, std::vector<Variation> variations) : drawn_(std::move(variations)) {
  for (Variation& v : drawn_) {
    bool is_whole = false;
    const MaterialField* const material = find_material_nuisance(v.name);
    if (material == nullptr && !is_of_objects(v) && v.mode != Mode::kFactor)
      is_whole = std::ranges::any_of(parameters_of(s, v), &SceneParameter::is_whole);
    double by = 0.0;
    draw_parameter(s.world.seed, v.name, is_whole, {&v.low, 1}, {&v.high, 1}, {&by, 1});
    v.drawn = by;
    if (v.name == "mass") mass_ = v;
    if (v.name == "size") size_ = v;
    if (is_of_objects(v)) continue;
    if (material == nullptr) {
      set_parameters(s, v, by);
      continue;
    }
    set_material(s, v, material->member, by);
    if (v.name != "friction") continue;
    friction_ = v;
    for (scene::ObjectSpec& object : s.objects) vary_friction(object);
  }
  if (size_ && size_->mode != Mode::kFactor) refuse(*size_, "must be a 'factor'");
  if (size_ && !s.joints.empty()) refuse(*size_, "the scene has joints, whose anchors do not scale");
  for (scene::ObjectSpec& object : s.objects) vary_size_and_mass(s, object);
}

void Nuisances::apply(const SceneSpec& s, scene::ObjectSpec& object) {
  vary_friction(object);
  vary_size_and_mass(s, object);
}

void Nuisances::vary_friction(scene::ObjectSpec& object) {
  if (!friction_ || !object.friction) return;
  object.friction = changed(*friction_, *object.friction, *friction_->drawn);
  require_valid(*friction_, object);
}

void Nuisances::vary_size_and_mass(const SceneSpec& s, scene::ObjectSpec& object) {
  if (object.fixed) return;
  if (size_) {
    scale(object, *size_->drawn);
    require_valid(*size_, object);
  }
  if (mass_) {
    const double declared = object.mass.value_or(s.materials[object.material].density * object.volume());
    object.mass = changed(*mass_, declared, *mass_->drawn);
    if (object.inertia) *object.inertia *= *object.mass / declared;
    require_valid(*mass_, object);
  }
}

// Its underside stays where it is, or higher. A mass of its own grows with the volume.
void Nuisances::scale(scene::ObjectSpec& object, double factor) {
  if (!(factor > 0.0)) refuse(*size_, "factor " + scene::format_number(factor) + ": must be above 0");
  const double volume = factor * factor * factor;
  const double reach = (object.orientation.toRotationMatrix().cwiseAbs() * object.half_extents()).z();
  object.position.z() += std::max(0.0, factor - 1.0) * reach;
  object.radius *= factor;
  object.height *= factor;
  object.size *= factor;
  object.centre_of_mass *= factor;
  if (object.mass) *object.mass *= volume;
  if (object.inertia) *object.inertia *= volume * factor * factor;
  if (object.solid) object.solid = scaled(object.solid, factor);
}

std::shared_ptr<const scene::Solid> Nuisances::scaled(const std::shared_ptr<const scene::Solid>& solid,
                                                      double factor) {
  for (const auto& [declared, larger] : scaled_)
    if (declared == solid) return larger;
  scaled_.emplace_back(solid, std::make_shared<const scene::Solid>(scene::scaled(*solid, factor)));
  return scaled_.back().second;
}

// Checks both ends of each range, and all of them at once.
void Nuisances::check(const SceneSpec& s, const std::vector<Variation>& variations) {
  const auto require_valid_at = [&s](const std::vector<Variation>& ends) {
    SceneSpec at_end = s;
    const Nuisances set(at_end, ends);
    if (!have_same_channels(s, at_end))
      refuse(ends.back(), "changes the range of a channel: give it to the script by an option");
    if (const std::string clause = validate(at_end.surface); !clause.empty()) refuse(ends.back(), clause);
  };
  for (const auto end : {&Variation::low, &Variation::high}) {
    std::vector<Variation> all;
    for (const Variation& v : variations) {
      all.push_back(v);
      all.back().low = all.back().high = v.*end;
      require_valid_at({all.back()});
    }
    if (all.size() > 1) require_valid_at(all);
  }
}

}  // namespace smartsurf::simulation
