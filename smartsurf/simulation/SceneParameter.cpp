#include "smartsurf/simulation/SceneParameter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "common/text/Number.h"
#include "common/text/Suggestion.h"
#include "common/text/Words.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/FaultMap.h"

namespace smartsurf::simulation {
namespace {

using scene::ObjectSpec;
using scene::SceneSpec;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

[[noreturn]] void refuse(const std::string& message) { throw scene::InputError(message); }

[[noreturn]] void refuse_unknown(std::string_view name, const std::string& part,
                                 const std::vector<std::string>& known) {
  const std::string meant = common::nearest_name(part, known);
  refuse("parameter '" + std::string(name) + "': no '" + part + "'" +
         (meant.empty() ? "; known: " + common::join(known) : " (did you mean '" + meant + "'?)"));
}

// Splits at the first dot; the second part is empty without one.
std::pair<std::string, std::string> split(std::string_view text) {
  const std::size_t dot = text.find('.');
  if (dot == std::string_view::npos) return {std::string(text), ""};
  return {std::string(text.substr(0, dot)), std::string(text.substr(dot + 1))};
}

template <class Item, class Predicate>
std::vector<std::size_t> indices_where(const std::vector<Item>& items, Predicate holds) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < items.size(); ++i)
    if (holds(items[i])) found.push_back(i);
  return found;
}

// ---- materials

// A copy of a material that belongs to one object, or to the surface, has no name.
std::size_t users_of(const SceneSpec& s, int material) {
  return std::ranges::count(s.objects, material, &ObjectSpec::material) +
         (s.surface.material == material ? 1 : 0);
}

scene::Material& own_material(SceneSpec& s, int& index) {
  if (!s.materials[index].name.empty() || users_of(s, index) > 1) {
    scene::Material copy = s.materials[index];
    copy.name.clear();
    s.materials.push_back(std::move(copy));
    index = static_cast<int>(s.materials.size()) - 1;
  }
  return s.materials[index];
}

void require_valid_material(const SceneSpec& s, int index) {
  scene::Material material = s.materials[index];
  material.name = "own";
  if (const std::string clause = validate(material); !clause.empty()) refuse(clause);
}

// ---- objects

struct ObjectField {
  const char* name;
  std::size_t size;
  void (*get)(const SceneSpec&, const ObjectSpec&, double*);
  void (*set)(SceneSpec&, ObjectSpec&, const double*);
};

template <Eigen::Vector3d ObjectSpec::*member>
void get_vector(const SceneSpec&, const ObjectSpec& o, double* to) {
  std::copy_n((o.*member).data(), 3, to);
}
template <Eigen::Vector3d ObjectSpec::*member>
void set_vector(SceneSpec&, ObjectSpec& o, const double* from) {
  o.*member = Eigen::Map<const Eigen::Vector3d>(from);
}
template <double scene::Material::*member>
void get_material(const SceneSpec& s, const ObjectSpec& o, double* to) {
  *to = s.materials[o.material].*member;
}
template <double scene::Material::*member>
void set_material(SceneSpec& s, ObjectSpec& o, const double* from) {
  own_material(s, o.material).*member = *from;
}

// About z, after pitch about y and roll about x. With x upright, the roll counts as 0.
double yaw_of(const Eigen::Quaterniond& q) {
  const double sine = 2.0 * (q.w() * q.z() + q.x() * q.y());
  const double cosine = 1.0 - 2.0 * (q.y() * q.y() + q.z() * q.z());
  constexpr double kUpright = 1e-6;
  if (std::hypot(sine, cosine) < kUpright)
    return std::remainder(2.0 * std::atan2(q.z(), q.w()), 2.0 * std::numbers::pi);
  return std::atan2(sine, cosine);
}

constexpr std::array<ObjectField, 10> kObjectFields{{
    {"mass", 1,
     [](const SceneSpec& s, const ObjectSpec& o, double* to) {
       *to = o.mass.value_or(s.materials[o.material].density * o.volume());
     },
     [](SceneSpec&, ObjectSpec& o, const double* from) { o.mass = *from; }},
    {"friction", 1,
     [](const SceneSpec& s, const ObjectSpec& o, double* to) {
       *to = o.friction.value_or(s.materials[o.material].friction);
     },
     [](SceneSpec&, ObjectSpec& o, const double* from) { o.friction = *from; }},
    {"rolling_friction", 1, get_material<&scene::Material::rolling_friction>,
     set_material<&scene::Material::rolling_friction>},
    {"restitution", 1, get_material<&scene::Material::restitution>,
     set_material<&scene::Material::restitution>},
    {"centre_of_mass", 3, get_vector<&ObjectSpec::centre_of_mass>, set_vector<&ObjectSpec::centre_of_mass>},
    {"position", 3, get_vector<&ObjectSpec::position>, set_vector<&ObjectSpec::position>},
    {"orientation", 4,
     [](const SceneSpec&, const ObjectSpec& o, double* to) {
       std::copy_n(o.orientation.coeffs().data(), 4, to);
     },
     [](SceneSpec&, ObjectSpec& o, const double* from) {
       o.orientation.coeffs() = Eigen::Map<const Eigen::Vector4d>(from);
       if (o.orientation.norm() >= 1e-6) o.orientation.normalize();
     }},
    {"yaw", 1, [](const SceneSpec&, const ObjectSpec& o, double* to) { *to = yaw_of(o.orientation); },
     [](SceneSpec&, ObjectSpec& o, const double* from) {  // roll and pitch stay
       o.orientation =
           Eigen::AngleAxisd(*from - yaw_of(o.orientation), Eigen::Vector3d::UnitZ()) * o.orientation;
     }},
    {"velocity", 3, get_vector<&ObjectSpec::velocity>, set_vector<&ObjectSpec::velocity>},
    {"angular_velocity", 3, get_vector<&ObjectSpec::angular_velocity>,
     set_vector<&ObjectSpec::angular_velocity>},
}};

std::vector<std::string> object_groups(const SceneSpec& s) {
  std::vector<std::string> groups{"*"};
  for (const ObjectSpec& o : s.objects)
    if (!o.label.empty() && std::ranges::find(groups, o.label) == groups.end()) groups.push_back(o.label);
  return groups;
}

// The objects of "*", "#3" or a label, ascending.
std::vector<std::size_t> objects_of(const SceneSpec& s, std::string_view name, const std::string& group) {
  if (group.starts_with('#')) {
    std::size_t id = 0;
    if (!common::parse_number(std::string_view(group).substr(1), id) || id >= s.objects.size())
      refuse("parameter '" + std::string(name) + "': no object " + group + "; the script declares " +
             std::to_string(s.objects.size()));
    return {id};
  }
  const auto found =
      indices_where(s.objects, [&](const ObjectSpec& o) { return group == "*" || o.label == group; });
  if (found.empty()) refuse_unknown(name, group, object_groups(s));
  return found;
}

// ---- actuators and sensors

bool is_settable(const scene::Parameter& p) {
  using Type = scene::Parameter::Type;
  return p.type != Type::kChoice && p.type != Type::kPointList && p.name != "top" && p.name != "length" &&
         p.name != "height";
}

template <class Kind>
const scene::Parameter* settable(const Kind& kind, std::string_view name) {
  const scene::Parameter* const p = kind.find_parameter(name);
  return p != nullptr && is_settable(*p) ? p : nullptr;
}

bool is_whole_number(const scene::Parameter& p) {
  return p.type == scene::Parameter::Type::kCount || p.type == scene::Parameter::Type::kFlag;
}

std::size_t numbers_of(const scene::Parameter& p) {
  using Type = scene::Parameter::Type;
  return p.type == Type::kVector ? 3 : p.type == Type::kSize || p.type == Type::kRange ? 2 : 1;
}

void get_values(const scene::ParameterValues& values, const scene::Parameter& p, std::span<double> to) {
  const auto found = values.find(p.name);
  const std::vector<double>& value = found == values.end() ? p.default_value : found->second;
  if (value.size() == to.size())
    std::ranges::copy(value, to.begin());
  else
    std::ranges::fill(to, kNan);
}

void set_values(scene::ParameterValues& values, const scene::Parameter& p, std::span<const double> from) {
  if (std::isnan(from.front()))
    values.erase(p.name);
  else
    values[p.name].assign(from.begin(), from.end());
}

void require_whole(const scene::ParameterValues& values, const scene::Parameter& p) {
  const auto found = values.find(p.name);
  if (!is_whole_number(p) || found == values.end()) return;
  for (const double v : found->second)
    if (v != std::round(v)) refuse(p.name + " = " + scene::format_number(v) + ": must be a whole number");
}

std::vector<std::string> settable_names(std::span<const scene::Parameter> parameters) {
  std::vector<std::string> names;
  for (const scene::Parameter& p : parameters)
    if (is_settable(p)) names.push_back(p.name);
  return names;
}

// ---- faults of cells

bool takes_value(const std::string& fault) {
  return fault != "dead" && fault != "stuck_low" && fault != "stuck_high";
}

bool is_of_actuator(const SceneSpec& s, const std::string& channel) {
  const auto actuators = s.surface.actuator_channels();
  return std::ranges::find(actuators, channel, &scene::ActuatorChannel::name) != actuators.end();
}

// The number says whether the cell has the fault: 1 sets it, 0 clears it, any other is refused.
bool is_set(const SceneSpec& s, const std::string& channel, const std::string& fault, int row, int column,
            double number) {
  if (number == 0.0 || number == 1.0) return number == 1.0;
  refuse("faults." + channel + "." + fault + " = " + scene::format_number(number) + " of cell (" +
         std::to_string(row) + ", " + std::to_string(column) + "): must be 0 or 1; faults." +
         (is_of_actuator(s, channel) ? "actuator." : "sensor.") + fault + " is a fraction of the cells");
}

void set_cell_faults(SceneSpec& s, const std::string& channel, const std::string& fault,
                     std::span<const double> from) {
  std::vector<scene::CellFault>& cells = s.surface.faults.cells;
  std::erase_if(cells, [&](const scene::CellFault& c) { return c.channel == channel && c.fault == fault; });
  for (std::size_t i = 0; i < from.size(); ++i) {
    const int row = static_cast<int>(i) / s.surface.columns, column = static_cast<int>(i) % s.surface.columns;
    if (std::isnan(from[i])) continue;
    if (takes_value(fault))
      cells.push_back({row, column, channel, fault, from[i]});
    else if (is_set(s, channel, fault, row, column, from[i]))
      cells.push_back({row, column, channel, fault, std::nullopt});
  }
  // Not the order of the calls: a later entry of a cell overrides an earlier one.
  std::ranges::stable_sort(cells, {}, [](const scene::CellFault& c) { return std::tie(c.channel, c.fault); });
}

struct FaultField {
  const char* name;
  double scene::ActuatorFaultSpec::*member;
};
constexpr std::array<FaultField, 4> kActuatorFaultFields{
    {{"stuck", &scene::ActuatorFaultSpec::stuck_fraction},
     {"dead", &scene::ActuatorFaultSpec::dead_fraction},
     {"weak", &scene::ActuatorFaultSpec::weak_fraction},
     {"weak_gain", &scene::ActuatorFaultSpec::weak_gain}}};

std::vector<std::string> faults_of_channel(const SceneSpec& s, const std::string& channel) {
  if (is_of_actuator(s, channel)) return surface::kActuatorFaults;
  if (std::ranges::count(s.surface.sensor_channels(), channel) > 0) return surface::kSensorFaults;
  return {};
}

void require_fraction(const std::string& name, double value) {
  if (!(value >= 0.0 && value <= 1.0))
    refuse(name + " = " + scene::format_number(value) + ": must be in [0, 1]");
}

void throw_if_broken(const std::string& clause) {
  if (!clause.empty()) refuse(clause);
}

}  // namespace

std::size_t SceneParameter::size() const {
  return std::accumulate(shape_.begin(), shape_.end(), std::size_t{1}, std::multiplies<>());
}

void SceneParameter::get(const SceneSpec& s, std::span<double> to) const { get_(s, to); }
void SceneParameter::set(SceneSpec& s, std::span<const double> from) const { set_(s, from); }
void SceneParameter::check(const SceneSpec& s) const {
  if (check_) check_(s);
}

// The makers, one for each first word of a name; `rest` is what follows it.
struct SceneParameter::Makers {
  static SceneParameter object(const SceneSpec& s, std::string_view name, const std::string& rest) {
    SceneParameter out;
    // A label may have dots; a field has none.
    const std::size_t dot = rest.rfind('.');
    const std::string group = rest.substr(0, dot),
                      field = dot == std::string::npos ? "" : rest.substr(dot + 1);
    const auto* const f =
        std::ranges::find(kObjectFields, field, [](const ObjectField& o) { return std::string(o.name); });
    if (f == kObjectFields.end()) {
      std::vector<std::string> known;
      for (const ObjectField& o : kObjectFields) known.emplace_back(o.name);
      refuse_unknown(name, field, known);
    }
    const std::vector<std::size_t> ids = objects_of(s, name, group);
    if (group == "*" || ids.size() > 1) out.shape_.push_back(ids.size());
    if (f->size > 1) out.shape_.push_back(f->size);
    out.components_ = f->size;
    out.get_ = [ids, f](const SceneSpec& from, std::span<double> to) {
      for (std::size_t i = 0; i < ids.size(); ++i) f->get(from, from.objects[ids[i]], &to[i * f->size]);
    };
    out.set_ = [ids, f](SceneSpec& to, std::span<const double> from) {
      for (std::size_t i = 0; i < ids.size(); ++i) {
        ObjectSpec& object = to.objects[ids[i]];
        f->set(to, object, &from[i * f->size]);
      }
    };
    out.check_ = [ids](const SceneSpec& scene) {
      for (const std::size_t id : ids) {
        throw_if_broken(validate(scene.objects[id]));
        require_valid_material(scene, scene.objects[id].material);
      }
    };
    return out;
  }

  static SceneParameter surface(const SceneSpec&, std::string_view name, const std::string& rest) {
    SceneParameter out;
    const auto* const f =
        std::ranges::find(kMaterialFields, rest, [](const MaterialField& m) { return std::string(m.name); });
    if (f == kMaterialFields.end())
      refuse_unknown(name, rest, {"friction", "rolling_friction", "restitution"});
    out.get_ = [f](const SceneSpec& from, std::span<double> to) {
      to[0] = from.materials[from.surface.material].*(f->member);
    };
    out.set_ = [f](SceneSpec& to, std::span<const double> from) {
      own_material(to, to.surface.material).*(f->member) = from[0];
    };
    out.check_ = [](const SceneSpec& scene) { require_valid_material(scene, scene.surface.material); };
    return out;
  }

  static SceneParameter world(const SceneSpec&, std::string_view name, const std::string& rest) {
    SceneParameter out;
    if (rest != "gravity") refuse_unknown(name, rest, {"gravity"});
    out.shape_ = {out.components_ = 3};
    out.get_ = [](const SceneSpec& from, std::span<double> to) {
      std::copy_n(from.world.gravity.data(), 3, to.begin());
    };
    out.set_ = [](SceneSpec& to, std::span<const double> from) {
      to.world.gravity = Eigen::Map<const Eigen::Vector3d>(from.data());
    };
    out.check_ = [](const SceneSpec& scene) { throw_if_broken(validate(scene.world)); };
    return out;
  }

  static SceneParameter actuator(const SceneSpec& s, std::string_view name, const std::string& rest) {
    SceneParameter out;
    const auto actuators = s.surface.effective_actuators();
    std::string model = actuators.front().model, field = rest;
    const auto* parameter = settable(*scene::find_actuator_kind(model), field);
    if (parameter == nullptr || actuators.size() > 1) {
      std::vector<std::string> models;
      for (const auto& a : actuators) models.push_back(a.model);
      std::tie(model, field) = split(rest);
      if (std::ranges::find(models, model) == models.end())
        refuse_unknown(name, rest,
                       actuators.size() > 1
                           ? models
                           : settable_names(scene::find_actuator_kind(models.front())->parameters));
      parameter = settable(*scene::find_actuator_kind(model), field);
      if (parameter == nullptr)
        refuse_unknown(name, field, settable_names(scene::find_actuator_kind(model)->parameters));
    }
    const auto indices = indices_where(actuators, [&](const auto& a) { return a.model == model; });
    const std::size_t size = out.components_ = numbers_of(*parameter);
    if (indices.size() > 1) out.shape_.push_back(indices.size());
    if (size > 1) out.shape_.push_back(size);
    out.get_ = [indices, parameter, size](const SceneSpec& from, std::span<double> to) {
      const auto all = from.surface.effective_actuators();
      for (std::size_t i = 0; i < indices.size(); ++i)
        get_values(all[indices[i]].values, *parameter, to.subspan(i * size, size));
    };
    out.set_ = [indices, parameter, size](SceneSpec& to, std::span<const double> from) {
      to.surface.actuators = to.surface.effective_actuators();
      for (std::size_t i = 0; i < indices.size(); ++i)
        set_values(to.surface.actuators[indices[i]].values, *parameter, from.subspan(i * size, size));
      derive_pin_spec(to.surface);
    };
    out.is_whole_ = is_whole_number(*parameter);
    out.check_ = [parameter](const SceneSpec& scene) {
      for (const scene::ActuatorSpec& a : scene.surface.actuators) {
        require_whole(a.values, *parameter);
        throw_if_broken(scene::find_actuator_kind(a.model)->validate(a));
      }
      throw_if_broken(validate(scene.surface));
    };
    return out;
  }

  static SceneParameter sensor(const SceneSpec& s, std::string_view name, const std::string& rest) {
    SceneParameter out;
    const auto [sensor, field] = split(rest);
    const auto it = std::ranges::find(s.surface.sensors, sensor, &scene::SensorSpec::name);
    if (it == s.surface.sensors.end()) {
      std::vector<std::string> known;
      for (const auto& other : s.surface.sensors) known.push_back(other.name);
      refuse_unknown(name, sensor, known);
    }
    const auto* const sensor_kind = scene::find_sensor_kind(it->model);
    const auto* const parameter = settable(*sensor_kind, field);
    if (parameter == nullptr) {
      std::vector<std::string> known = settable_names(sensor_kind->parameters);
      for (const std::string& other : settable_names(scene::sensor_error_parameters()))
        known.push_back(other);
      refuse_unknown(name, field, known);
    }
    const std::size_t index = it - s.surface.sensors.begin();
    out.components_ = numbers_of(*parameter);
    if (out.components_ > 1) out.shape_ = {out.components_};
    out.get_ = [index, parameter](const SceneSpec& from, std::span<double> to) {
      get_values(from.surface.sensors[index].values, *parameter, to);
    };
    out.set_ = [index, parameter](SceneSpec& to, std::span<const double> from) {
      set_values(to.surface.sensors[index].values, *parameter, from);
    };
    out.is_whole_ = is_whole_number(*parameter);
    out.check_ = [index, parameter, sensor_kind](const SceneSpec& scene) {
      require_whole(scene.surface.sensors[index].values, *parameter);
      throw_if_broken(sensor_kind->validate(scene.surface.sensors[index]));
    };
    return out;
  }

  static SceneParameter faults(const SceneSpec& s, std::string_view name, const std::string& rest) {
    const auto [group, fault] = split(rest);
    if (group == "actuator") return fault == "latency" ? latency() : actuator_fault(name, fault);
    return group == "sensor" ? sensor_fault(name, fault) : cell_fault(s, name, rest);
  }

  static SceneParameter latency() {
    SceneParameter out;
    out.get_ = [](const SceneSpec& from, std::span<double> to) {
      to[0] = from.surface.faults.actuator.latency_ticks;
    };
    out.set_ = [](SceneSpec& to, std::span<const double> from) {
      // -1, which the check refuses, for all that an int cannot hold.
      const bool fits = from[0] >= 0.0 && from[0] <= 1000.0 && from[0] == std::round(from[0]);
      to.surface.faults.actuator.latency_ticks = fits ? static_cast<int>(from[0]) : -1;
    };
    out.is_whole_ = true;
    out.check_ = [](const SceneSpec& scene) {
      if (scene.surface.faults.actuator.latency_ticks < 0)
        refuse("faults.actuator.latency: must be a whole number, 0 to 1000");
    };
    return out;
  }

  static SceneParameter actuator_fault(std::string_view name, const std::string& fault) {
    SceneParameter out;
    const auto* const f = std::ranges::find(kActuatorFaultFields, fault,
                                            [](const FaultField& field) { return std::string(field.name); });
    if (f == kActuatorFaultFields.end())
      refuse_unknown(name, fault, {"stuck", "dead", "weak", "weak_gain", "latency"});
    out.get_ = [f](const SceneSpec& from, std::span<double> to) {
      to[0] = from.surface.faults.actuator.*(f->member);
    };
    out.set_ = [f](SceneSpec& to, std::span<const double> from) {
      to.surface.faults.actuator.*(f->member) = from[0];
    };
    out.check_ = [f](const SceneSpec& scene) {
      const scene::ActuatorFaultSpec& a = scene.surface.faults.actuator;
      require_fraction(std::string("faults.actuator.") + f->name, a.*(f->member));
      if (const double total = a.stuck_fraction + a.dead_fraction + a.weak_fraction; total > 1.0 + 1e-9)
        refuse("faults.actuator: stuck, dead and weak add up to " + scene::format_number(total) +
               " of the cells: must be at most 1");
    };
    return out;
  }

  static SceneParameter sensor_fault(std::string_view name, const std::string& fault) {
    SceneParameter out;
    const auto errors = scene::sensor_error_parameters();
    const auto parameter = std::ranges::find(errors, fault, &scene::Parameter::name);
    if (parameter == errors.end()) refuse_unknown(name, fault, settable_names(errors));
    out.get_ = [parameter](const SceneSpec& from, std::span<double> to) {
      get_values(from.surface.faults.sensor_errors, *parameter, to);
    };
    out.set_ = [parameter](SceneSpec& to, std::span<const double> from) {
      set_values(to.surface.faults.sensor_errors, *parameter, from);
    };
    out.is_whole_ = is_whole_number(*parameter);
    out.check_ = [parameter](const SceneSpec& scene) {
      require_whole(scene.surface.faults.sensor_errors, *parameter);
      throw_if_broken(scene::validate_sensor_errors("faults.sensor", scene.surface.faults.sensor_errors));
    };
    return out;
  }

  static SceneParameter cell_fault(const SceneSpec& s, std::string_view name, const std::string& rest) {
    SceneParameter out;
    // A channel's name may have dots.
    const std::size_t dot = rest.rfind('.');
    const std::string channel = rest.substr(0, dot),
                      of = dot == std::string::npos ? "" : rest.substr(dot + 1);
    const std::vector<std::string> known = faults_of_channel(s, channel);
    if (known.empty()) {
      std::vector<std::string> channels = s.surface.sensor_channels();
      for (const auto& c : s.surface.actuator_channels()) channels.push_back(c.name);
      channels.insert(channels.end(), {"actuator", "sensor"});
      refuse_unknown(name, channel, channels);
    }
    if (std::ranges::find(known, of) == known.end()) refuse_unknown(name, of, known);
    const std::size_t cells = s.surface.cell_count();
    out.shape_ = {static_cast<std::size_t>(s.surface.rows), static_cast<std::size_t>(s.surface.columns)};
    out.get_ = [channel, of, cells](const SceneSpec& from, std::span<double> to) {
      std::ranges::fill(to.first(cells), takes_value(of) ? kNan : 0.0);
      for (const scene::CellFault& c : from.surface.faults.cells)
        if (c.channel == channel && c.fault == of)
          to[from.surface.index(c.row, c.column)] = c.value.value_or(1.0);
    };
    out.set_ = [channel, of](SceneSpec& to, std::span<const double> from) {
      set_cell_faults(to, channel, of, from);
    };
    out.is_per_cell_ = true;
    return out;
  }
};

SceneParameter SceneParameter::find(const SceneSpec& s, std::string_view name) {
  struct Kind {
    const char* name;
    SceneParameter (*make)(const SceneSpec&, std::string_view name, const std::string& rest);
  };
  static constexpr std::array<Kind, 6> kKinds{{{"object", Makers::object},
                                               {"surface", Makers::surface},
                                               {"world", Makers::world},
                                               {"actuator", Makers::actuator},
                                               {"sensor", Makers::sensor},
                                               {"faults", Makers::faults}}};
  const auto [word, rest] = split(name);
  const auto kind = std::ranges::find_if(kKinds, [&](const Kind& k) { return word == k.name; });
  if (kind == kKinds.end()) {
    std::vector<std::string> known;
    for (const Kind& k : kKinds) known.emplace_back(k.name);
    refuse_unknown(name, word, known);
  }
  SceneParameter out = kind->make(s, name, rest);
  out.name_ = name;
  return out;
}

std::vector<std::string> SceneParameter::names(const SceneSpec& s) {
  std::vector<std::string> all;
  if (!s.objects.empty())
    for (const std::string& group : object_groups(s))
      for (const ObjectField& field : kObjectFields) all.push_back("object." + group + "." + field.name);
  for (const MaterialField& field : kMaterialFields) all.push_back(std::string("surface.") + field.name);
  all.emplace_back("world.gravity");
  const auto actuators = s.surface.effective_actuators();
  for (const scene::ActuatorSpec& a : actuators)
    for (const std::string& parameter : settable_names(scene::find_actuator_kind(a.model)->parameters)) {
      std::string name = "actuator." + (actuators.size() > 1 ? a.model + "." : "") + parameter;
      if (std::ranges::find(all, name) == all.end()) all.push_back(std::move(name));
    }
  for (const scene::SensorSpec& sensor : s.surface.sensors) {
    for (const std::string& p : settable_names(scene::find_sensor_kind(sensor.model)->parameters))
      all.push_back("sensor." + sensor.name + "." + p);
    for (const std::string& p : settable_names(scene::sensor_error_parameters()))
      all.push_back("sensor." + sensor.name + "." + p);
  }
  for (const FaultField& field : kActuatorFaultFields)
    all.push_back(std::string("faults.actuator.") + field.name);
  all.emplace_back("faults.actuator.latency");
  for (const std::string& p : settable_names(scene::sensor_error_parameters()))
    all.push_back("faults.sensor." + p);
  for (const auto& channel : s.surface.actuator_channels())
    for (const std::string& fault : surface::kActuatorFaults)
      all.push_back("faults." + channel.name + "." + fault);
  for (const std::string& channel : s.surface.sensor_channels())
    for (const std::string& fault : surface::kSensorFaults) all.push_back("faults." + channel + "." + fault);
  return all;
}

}  // namespace smartsurf::simulation
