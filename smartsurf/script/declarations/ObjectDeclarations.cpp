// sphere, box, cylinder, capsule, cone, hull, mesh: they declare objects while the script loads and spawn
// them while the simulation runs.
#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "common/text/Printable.h"
#include "smartsurf/scene/SolidFactory.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/declarations/Creation.h"
#include "smartsurf/script/lua/SandboxFiles.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxObjects = 1'000'000;
constexpr std::size_t kMaxHullPoints = 100'000;
constexpr std::size_t kMaxLabelBytes = 100;

// The Lua function of one shape: the fields that it takes besides kCommonFields, and their reader.
struct ShapeBinding {
  std::string_view name;
  scene::ShapeKind kind;
  std::array<std::string_view, 6> fields;  // padded with ""
  void (*read)(ScriptContext&, lua_State*, const TableReader&, scene::ObjectSpec&);
};

constexpr std::array<std::string_view, 14> kCommonFields{
    "position", "orientation", "velocity", "angular_velocity", "mass",  "com",  "inertia",
    "friction", "fixed",       "material", "colour",           "label", "pole", "moment"};

std::vector<std::string_view> field_names(const ShapeBinding& shape) {
  std::vector<std::string_view> all;
  for (const std::string_view field : shape.fields)
    if (!field.empty()) all.push_back(field);
  all.insert(all.end(), kCommonFields.begin(), kCommonFields.end());
  return all;
}

// {ixx, iyy, izz} or {ixx, iyy, izz, ixy, ixz, iyz}
Eigen::Matrix3d check_inertia(lua_State* L, int index, const std::string& name) {
  const bool is_diagonal = lua_type(L, index) == LUA_TTABLE && lua_rawlen(L, index) == 3;
  const auto i =
      check_numbers(L, index, name, is_diagonal ? 3 : 6, "{ixx, iyy, izz} or {ixx, iyy, izz, ixy, ixz, iyz}");
  Eigen::Matrix3d inertia = Eigen::Vector3d(i[0], i[1], i[2]).asDiagonal();
  if (!is_diagonal) {
    inertia(0, 1) = inertia(1, 0) = i[3];
    inertia(0, 2) = inertia(2, 0) = i[4];
    inertia(1, 2) = inertia(2, 1) = i[5];
  }
  return inertia;
}

void read_common(const ScriptContext& context, lua_State* L, const TableReader& fields,
                 scene::ObjectSpec& object) {
  fields.read_required("position", object.position);
  fields.read("orientation", object.orientation);
  fields.read("velocity", object.velocity);
  fields.read("angular_velocity", object.angular_velocity);
  fields.read("mass", object.mass);
  fields.read("com", object.centre_of_mass);
  fields.visit("inertia",
               [&](int i, const std::string& name) { object.inertia = check_inertia(L, i, name); });
  fields.read("friction", object.friction);
  fields.read("fixed", object.fixed);
  fields.read("pole", object.magnetic_pole);
  fields.read("moment", object.magnetic_moment);
  fields.visit("material", [&](int i, const std::string& name) {
    object.material = check_material(context, L, i, name);
  });
  object.colour = scene::kLookColours.at(context.spec.materials.at(object.material).look);
  fields.read("colour", object.colour);
  fields.visit("label", [&](int i, const std::string& name) {
    object.label = check_string(L, i, name);
    if (!is_label(object.label)) throw_invalid_value(L, i, name, kLabelRule);
  });
}

void read_radius(ScriptContext&, lua_State*, const TableReader& fields, scene::ObjectSpec& object) {
  fields.read_required("radius", object.radius);
}

void read_radius_and_height(ScriptContext& context, lua_State* L, const TableReader& fields,
                            scene::ObjectSpec& object) {
  read_radius(context, L, fields, object);
  fields.read_required("height", object.height);
}

void read_size(ScriptContext&, lua_State*, const TableReader& fields, scene::ObjectSpec& object) {
  fields.read_required("size", object.size);
}

// Prefixes each warning with the script's location.
void report_warnings(const ScriptContext& context, lua_State* L, const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) {
    const std::string line = context.interpreter->current_location(L) + ": " + warning;
    if (context.options.report_warning)
      context.options.report_warning(line);
    else
      common::print_message(line + "\n");
  }
}

}  // namespace

bool is_label(const std::string& text) {
  return text.size() <= kMaxLabelBytes && to_single_line(text) == text;
}

std::shared_ptr<const scene::Solid> make_solid(
    const ScriptContext& context, lua_State* L, const std::string& subject,
    const std::function<scene::SolidResult(scene::SolidFactory&)>& make) {
  if (!context.options.solid_factory)
    throw ScriptError("hull and mesh are not available to a script loaded this way");
  scene::SolidResult result;
  try {
    const std::string name = subject.substr(0, subject.find_last_not_of("=: ") + 1);
    const Interpreter::NamedOperation operation(
        *context.interpreter, context.interpreter->current_location(L) + ": " + name +
                                  ": its convex pieces take longer to find than a script may run: give the "
                                  "mesh fewer triangles (a few thousand are enough)");
    result = make(*context.options.solid_factory);
  } catch (const scene::InputError& e) {
    throw ScriptError(subject + e.what());
  }
  report_warnings(context, L, result.warnings);
  return result.solid;
}

// Object ids start at 0 and follow the order of creation, as in recordings and in the view.
scene::ObjectId add_object(ScriptContext& context, const std::string& subject,
                           const scene::ObjectSpec& object) {
  if (context.phase == Phase::kRunning) return context.simulation->spawn(object);
  auto& objects = context.spec.objects;
  if (objects.size() >= kMaxObjects) throw ScriptError(subject + ": more than 1000000 objects");
  objects.push_back(object);
  return static_cast<scene::ObjectId>(objects.size() - 1);
}

namespace {

void read_mesh_source(const ScriptContext& context, lua_State* L, const TableReader& fields,
                      scene::MeshRequest& request) {
  fields.visit("file", [&](int i, const std::string& name) {
    const std::string path = check_string(L, i, name);
    request.file = resolve_readable_path(context, name, path);
    request.display_name = to_single_line(path);
  });
  fields.visit("scale", [&](int i, const std::string& name) {
    request.scale = check_number(L, i, name);
    if (!(request.scale >= 1e-9 && request.scale <= 1e9))
      throw_invalid_value(L, i, name, "in [1e-09, 1e+09]");
  });
  fields.visit("unit", [&](int i, const std::string& name) {
    const scene::PhysicalUnit unit = check_physical_unit(L, i, name);
    if (!context.spec.world.unit)
      throw ScriptError(name + ": the world has no unit; declare it before, as in world{unit = 'mm'}");
    request.scale *= unit.metres / context.spec.world.unit->metres;
  });
}

void read_mesh(ScriptContext& context, lua_State* L, const TableReader& fields, scene::ObjectSpec& object) {
  scene::MeshRequest request;
  fields.require("file");
  read_mesh_source(context, L, fields, request);
  fields.read("decompose", request.decompose);
  int pieces = 0;
  fields.read("pieces", pieces, 1, scene::kMaxHulls);
  if (pieces > 0) request.max_hulls = pieces;
  fields.visit("tolerance", [&](int i, const std::string& name) {
    request.tolerance = check_number(L, i, name);
    if (!(request.tolerance > 0.0)) throw_invalid_value(L, i, name, "greater than 0");
  });
  object.solid = make_solid(
      context, L, "mesh.file = ", [&](scene::SolidFactory& factory) { return factory.load_mesh(request); });
}

std::vector<Eigen::Vector3d> check_points(ScriptContext& context, lua_State* L, int index,
                                          const std::string& name) {
  if (lua_type(L, index) != LUA_TTABLE)
    throw_invalid_value(L, index, name, "a list of points, {{x, y, z}, ...}");
  const lua_Unsigned count = lua_rawlen(L, index);
  if (count > kMaxHullPoints) throw ScriptError(name + ": more than 100000 points");
  context.interpreter->charge(L, count);
  std::vector<Eigen::Vector3d> points;
  for_each_element(L, index, name,
                   [&](int i, const std::string& element) { points.push_back(check_vector(L, i, element)); });
  return points;
}

// The points of each convex hull.
std::vector<std::vector<Eigen::Vector3d>> check_parts(ScriptContext& context, lua_State* L, int index,
                                                      const std::string& name) {
  if (lua_type(L, index) != LUA_TTABLE)
    throw_invalid_value(L, index, name, "a list of lists of points, {{{x, y, z}, ...}, ...}");
  const lua_Unsigned count = lua_rawlen(L, index);
  if (count < 1 || count > scene::kMaxHulls)
    throw ScriptError(name + ": has " + std::to_string(count) + " parts; must be 1 to " +
                      std::to_string(scene::kMaxHulls));
  std::vector<std::vector<Eigen::Vector3d>> parts;
  for_each_element(L, index, name, [&](int i, const std::string& element) {
    parts.push_back(check_points(context, L, i, element));
  });
  return parts;
}

void read_hull(ScriptContext& context, lua_State* L, const TableReader& fields, scene::ObjectSpec& object) {
  if (fields.has("points") + fields.has("parts") + fields.has("file") != 1)
    throw ScriptError(
        "hull: takes one of points = {{x, y, z}, ...}, parts = {{{x, y, z}, ...}, ...} and file = "
        "'part.stl'");
  if (fields.has("file")) {
    scene::MeshRequest request;
    read_mesh_source(context, L, fields, request);
    object.solid = make_solid(
        context, L, "hull.file = ", [&](scene::SolidFactory& factory) { return factory.make_hull(request); });
    return;
  }
  for (const std::string_view field : {"scale", "unit"})
    if (fields.has(field))
      throw ScriptError("hull." + std::string(field) + ": applies only to file; points are in u");
  fields.visit("parts", [&](int i, const std::string& name) {
    const std::vector<std::vector<Eigen::Vector3d>> parts = check_parts(context, L, i, name);
    object.solid = make_solid(context, L, name + ": ", [&](scene::SolidFactory& factory) {
      return factory.make_compound(parts, "hull");
    });
  });
  fields.visit("points", [&](int i, const std::string& name) {
    const std::vector<Eigen::Vector3d> points = check_points(context, L, i, name);
    object.solid = make_solid(context, L, name + ": ", [&](scene::SolidFactory& factory) {
      return factory.make_hull(points, "hull");
    });
  });
}

constexpr ShapeBinding kSphere{"sphere", scene::ShapeKind::kSphere, {"radius"}, read_radius};
constexpr ShapeBinding kBox{"box", scene::ShapeKind::kBox, {"size"}, read_size};
constexpr ShapeBinding kCylinder{
    "cylinder", scene::ShapeKind::kCylinder, {"radius", "height"}, read_radius_and_height};
constexpr ShapeBinding kCapsule{
    "capsule", scene::ShapeKind::kCapsule, {"radius", "height"}, read_radius_and_height};
constexpr ShapeBinding kCone{"cone", scene::ShapeKind::kCone, {"radius", "height"}, read_radius_and_height};
constexpr ShapeBinding kHull{
    "hull", scene::ShapeKind::kSolid, {"points", "parts", "file", "scale", "unit"}, read_hull};
constexpr ShapeBinding kMesh{"mesh",
                             scene::ShapeKind::kSolid,
                             {"file", "scale", "unit", "decompose", "pieces", "tolerance"},
                             read_mesh};

template <const ShapeBinding& shape>
int create(ScriptContext& context, lua_State* L) {
  static const std::vector<std::string_view> known = field_names(shape);
  const TableReader fields(L, 1, std::string(shape.name), known);
  scene::ObjectSpec object;
  object.shape = shape.kind;
  shape.read(context, L, fields, object);
  read_common(context, L, fields, object);
  const std::string subject(shape.name);
  throw_if_invalid(validate(object), subject + ".");
  lua_pushinteger(L, static_cast<lua_Integer>(add_object(context, subject, object)));
  return 1;
}

template <const ShapeBinding& shape>
void bind_shape(lua_State* L) {
  lua_register(L, shape.name.data(), (guarded<create<shape>>));
}

}  // namespace

void bind_objects(lua_State* L) {
  bind_shape<kSphere>(L);
  bind_shape<kBox>(L);
  bind_shape<kCylinder>(L);
  bind_shape<kCapsule>(L);
  bind_shape<kCone>(L);
  bind_shape<kHull>(L);
  bind_shape<kMesh>(L);
}

}  // namespace smartsurf::script
