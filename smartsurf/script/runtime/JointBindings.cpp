// joint{…} creates a joint, while the script loads or runs; joint(id) is a handle to one of the running
// simulation.
#include <algorithm>
#include <array>
#include <iterator>
#include <string>
#include <vector>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/declarations/Creation.h"
#include "smartsurf/script/lua/TableReader.h"
#include "smartsurf/script/lua/Userdata.h"

namespace smartsurf::script {
namespace {

constexpr const char* kJointType = "joint";
constexpr std::size_t kMaxJoints = 100'000;

scene::ObjectId check_joined_object(lua_State* L, int index, const std::string& name) {
  if (const scene::ObjectId* const id = test_handle(L, index, "object")) return *id;
  return static_cast<scene::ObjectId>(check_integer(L, index, name, 0, UINT32_MAX));
}

scene::JointKind check_joint_kind(lua_State* L, int index, const std::string& name) {
  const std::string kind = check_string(L, index, name);
  const auto* const known = std::ranges::find(scene::kJointKindNames, kind);
  if (known == std::end(scene::kJointKindNames))
    throw_invalid_value(L, index, name, "'hinge', 'slider', 'ball' or 'fixed'");
  return static_cast<scene::JointKind>(known - scene::kJointKindNames);
}

scene::JointMotor read_motor(lua_State* L, int index, const std::string& name, scene::JointKind kind) {
  const std::string_view max_effort = kind == scene::JointKind::kSlider ? "max_force" : "max_torque";
  const TableReader fields(L, index, name, {"speed", max_effort});
  scene::JointMotor motor;
  fields.read_required("speed", motor.speed);
  fields.read_required(max_effort, motor.max_effort);
  return motor;
}

scene::JointSpring read_spring(lua_State* L, int index, const std::string& name) {
  const TableReader fields(L, index, name, {"stiffness", "damping", "rest"});
  scene::JointSpring spring;
  fields.read_required("stiffness", spring.stiffness);
  fields.read("damping", spring.damping);
  fields.read("rest", spring.rest);
  return spring;
}

scene::JointSpec read_joint(lua_State* L) {
  const TableReader fields(
      L, 1, "joint",
      {"kind", "a", "b", "anchor", "axis", "limits", "friction", "spring", "motor", "collide"});
  scene::JointSpec spec;
  fields.require("kind");
  fields.visit("kind", [&](int i, const std::string& name) { spec.kind = check_joint_kind(L, i, name); });
  fields.require("a");
  fields.visit("a", [&](int i, const std::string& name) { spec.a = check_joined_object(L, i, name); });
  fields.visit("b", [&](int i, const std::string& name) { spec.b = check_joined_object(L, i, name); });
  fields.read_required("anchor", spec.anchor);
  if (spec.has_coordinate())
    fields.read_required("axis", spec.axis);
  else
    fields.visit("axis", [&](int, const std::string& name) {
      throw ScriptError(name + ": a " + scene::kJointKindNames[static_cast<int>(spec.kind)] +
                        " joint has none; only hinge and slider do");
    });
  fields.visit("limits", [&](int i, const std::string& name) {
    const auto limits = check_numbers(L, i, name, 2, "{lower, upper}");
    spec.limits = {limits[0], limits[1]};
  });
  fields.read("friction", spec.friction);
  fields.visit("spring", [&](int i, const std::string& name) { spec.spring = read_spring(L, i, name); });
  fields.visit("motor",
               [&](int i, const std::string& name) { spec.motor = read_motor(L, i, name, spec.kind); });
  fields.read("collide", spec.collide);
  return spec;
}

void require_joined_object(const ScriptContext& context, scene::ObjectId id, const std::string& field) {
  const bool exists =
      context.phase == Phase::kRunning ? context.simulation->is_alive(id) : id < context.spec.objects.size();
  if (!exists)
    throw ScriptError("joint." + field + " = " + std::to_string(id) +
                      ": there is no such object; create it before the joint");
}

bool is_immovable(const ScriptContext& context, scene::ObjectId id) {
  return context.phase == Phase::kRunning ? context.simulation->is_fixed(id) : context.spec.objects[id].fixed;
}

}  // namespace

scene::JointId add_joint(ScriptContext& context, const scene::JointSpec& spec) {
  throw_if_invalid(validate(spec), "joint.");
  require_joined_object(context, spec.a, "a");
  if (spec.b) require_joined_object(context, *spec.b, "b");
  if (is_immovable(context, spec.a) && (!spec.b || is_immovable(context, *spec.b)))
    throw ScriptError("joint.a = " + std::to_string(spec.a) + ": is fixed, and so is " +
                      (spec.b ? "b" : "the table") + ": one of them must be able to move");
  if (context.phase == Phase::kRunning) return context.simulation->add_joint(spec);
  auto& joints = context.spec.joints;
  if (joints.size() >= kMaxJoints) throw ScriptError("joint: more than 100000 joints");
  joints.push_back(spec);
  return static_cast<scene::JointId>(joints.size() - 1);
}

namespace {

int joint(ScriptContext& context, lua_State* L) {
  if (lua_type(L, 1) == LUA_TTABLE) {
    lua_pushinteger(L, static_cast<lua_Integer>(add_joint(context, read_joint(L))));
    return 1;
  }
  require_running(context, "joint(id)");
  if (test_handle(L, 1, kJointType) != nullptr) {
    lua_settop(L, 1);
    return 1;
  }
  const auto id = static_cast<scene::JointId>(
      check_integer(L, 1, "joint: the id, or the table of a new joint,", 0, UINT32_MAX));
  push_handle(L, kJointType, id);
  return 1;
}

scene::JointId check_joint(const ScriptContext& context, lua_State* L, const char* method) {
  require_running(context, std::string("joint:") + method);
  const scene::JointId id = check_handle(L, kJointType, method);
  if (!context.simulation->has_joint(id))
    throw ScriptError(std::string("joint:") + method + ": there is no joint " + std::to_string(id) +
                      " (removed, by itself or with an object, or never created)");
  return id;
}

scene::JointId check_joint_with_coordinate(const ScriptContext& context, lua_State* L, const char* method) {
  const scene::JointId id = check_joint(context, L, method);
  const scene::JointKind kind = context.simulation->joint_kind(id);
  if (kind != scene::JointKind::kHinge && kind != scene::JointKind::kSlider)
    throw ScriptError(std::string("joint:") + method + ": joint " + std::to_string(id) + " is a " +
                      scene::kJointKindNames[static_cast<int>(kind)] +
                      " joint; only hinge and slider have a coordinate");
  return id;
}

int joint_id(ScriptContext&, lua_State* L) {
  lua_pushinteger(L, static_cast<lua_Integer>(check_handle(L, kJointType, "id")));
  return 1;
}

int joint_alive(ScriptContext& context, lua_State* L) {
  require_running(context, "joint:alive");
  lua_pushboolean(L, context.simulation->has_joint(check_handle(L, kJointType, "alive")) ? 1 : 0);
  return 1;
}

int remove_joint(ScriptContext& context, lua_State* L) {
  context.simulation->remove_joint(check_joint(context, L, "remove"));
  return 0;
}

int push_quantity(const ScriptContext& context, lua_State* L, const char* method,
                  double scene::JointState::*quantity) {
  const scene::JointId joint = check_joint_with_coordinate(context, L, method);
  lua_pushnumber(L, context.simulation->joint_state(joint).*quantity);
  return 1;
}

int joint_coordinate(ScriptContext& context, lua_State* L) {
  return push_quantity(context, L, "coordinate", &scene::JointState::coordinate);
}

int joint_speed(ScriptContext& context, lua_State* L) {
  return push_quantity(context, L, "speed", &scene::JointState::speed);
}

int joint_effort(ScriptContext& context, lua_State* L) {
  return push_quantity(context, L, "effort", &scene::JointState::effort);
}

int joint_force(ScriptContext& context, lua_State* L) {
  const Eigen::Vector3d f = context.simulation->joint_state(check_joint(context, L, "force")).force;
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, f[i]);
  return 3;
}

// Reads the argument of joint:motor or joint:spring into a joint of the same kind, and checks it.
template <class Read>
scene::JointId check_joint_part(const ScriptContext& context, lua_State* L, const char* method, Read read) {
  const scene::JointId joint = check_joint_with_coordinate(context, L, method);
  scene::JointSpec spec{.kind = context.simulation->joint_kind(joint)};
  read(spec);
  throw_if_invalid(validate(spec), "joint:");
  return joint;
}

int set_joint_motor(ScriptContext& context, lua_State* L) {
  scene::JointMotor motor;
  const scene::JointId joint = check_joint_part(context, L, "motor", [&](scene::JointSpec& spec) {
    spec.motor = motor = read_motor(L, 2, "motor", spec.kind);
  });
  context.simulation->set_motor(joint, motor);
  return 0;
}

int set_joint_spring(ScriptContext& context, lua_State* L) {
  scene::JointSpring spring;
  const scene::JointId joint = check_joint_part(context, L, "spring", [&](scene::JointSpec& spec) {
    spec.spring = spring = read_spring(L, 2, "spring");
  });
  context.simulation->set_spring(joint, spring);
  return 0;
}

}  // namespace

void bind_joints(lua_State* L) {
  constexpr std::array<luaL_Reg, 9> kMethods{{{"id", guarded<joint_id>},
                                              {"alive", guarded<joint_alive>},
                                              {"remove", guarded<remove_joint>},
                                              {"coordinate", guarded<joint_coordinate>},
                                              {"speed", guarded<joint_speed>},
                                              {"effort", guarded<joint_effort>},
                                              {"force", guarded<joint_force>},
                                              {"motor", guarded<set_joint_motor>},
                                              {"spring", guarded<set_joint_spring>}}};
  register_handle_type(L, kJointType, kMethods);
  lua_register(L, "joint", guarded<joint>);
}

}  // namespace smartsurf::script
