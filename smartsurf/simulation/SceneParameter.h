// The numbers of a loaded scene that may differ between episodes, by name (docs/python.md lists them):
//
//   object.LABEL.mass, object.#3.mass, object.*.mass     of objects with a label, of object 3, of all
//   surface.friction, world.gravity
//   actuator.max_speed, actuator.wheels.max_spin         of the only actuator, of all of a model
//   sensor.proximity.noise                               of a sensor
//   faults.actuator.dead, faults.sensor.noise            of all cells at random
//   faults.height.stuck                                  of each cell: NaN where it has no such fault
//
// Setting one gives the scene that the script would have declared with the value. Values that shape arrays or
// channels cannot be set.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::simulation {

struct MaterialField {
  const char* name;
  double scene::Material::*member;
};
inline constexpr std::array<MaterialField, 3> kMaterialFields{
    {{"friction", &scene::Material::friction},
     {"rolling_friction", &scene::Material::rolling_friction},
     {"restitution", &scene::Material::restitution}}};

class SceneParameter {
 public:
  // Throws scene::InputError, one clause, if the scene has no such parameter.
  static SceneParameter find(const scene::SceneSpec&, std::string_view name);
  // The names of all parameters, those of objects under `*` and each label.
  static std::vector<std::string> names(const scene::SceneSpec&);

  const std::string& name() const { return name_; }
  // The axes of the value, outermost first: empty for a number, else objects (of "*" and of labels that
  // several objects have) or actuators (of a model that several have), rows × columns, components.
  const std::vector<std::size_t>& shape() const { return shape_; }
  std::size_t size() const;
  // 1: a number, or one for each object, actuator or cell.
  std::size_t components() const { return components_; }
  bool is_whole() const { return is_whole_; }        // takes whole numbers only
  bool is_per_cell() const { return is_per_cell_; }  // a fault of cells, NaN: none

  // NaN where the script has declared no value and there is no default: set() leaves it so.
  void get(const scene::SceneSpec&, std::span<double>) const;
  void set(scene::SceneSpec&, std::span<const double>) const;
  // Throws scene::InputError, one clause, unless the script could declare the value that the scene has. After
  // all parameters are set, because limits may depend on several. Faults of cells are checked by the surface.
  // All three for scenes with the objects, actuators and sensors of that given to find().
  void check(const scene::SceneSpec&) const;

 private:
  struct Makers;

  std::string name_;
  std::vector<std::size_t> shape_;
  std::size_t components_ = 1;
  bool is_whole_ = false, is_per_cell_ = false;
  std::function<void(const scene::SceneSpec&)> check_;
  std::function<void(const scene::SceneSpec&, std::span<double>)> get_;
  std::function<void(scene::SceneSpec&, std::span<const double>)> set_;
};

}  // namespace smartsurf::simulation
