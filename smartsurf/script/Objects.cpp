// sphere, box, cylinder, capsule, cone, hull, mesh: declared while the script loads, spawned while the
// simulation runs.
#include <array>
#include <cstdio>
#include <string>
#include <vector>

#include "smartsurf/scene/SolidSource.h"
#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Files.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostObjects = 1'000'000;
constexpr std::size_t kMostPoints = 100'000;  // of a hull
constexpr std::size_t kLongestLabel = 100;
constexpr int kMostPieces = 256;

// One kind of object: its name, what it takes beside what all take, and how that is read.
struct Shape {
  std::string_view name;
  scene::ShapeKind kind;
  std::array<std::string_view, 5> fields;  // "" where there are fewer
  void (*read)(Session&, lua_State*, const Fields&, scene::ObjectSpec&);
};

constexpr std::array<std::string_view, 11> kCommon{"position", "orientation", "velocity", "angular_velocity",
                                                   "mass",     "fixed",       "material", "colour",
                                                   "label",    "pole",        "moment"};

std::vector<std::string_view> fields_of(const Shape& shape) {
  std::vector<std::string_view> all;
  for (const std::string_view field : shape.fields)
    if (!field.empty()) all.push_back(field);
  all.insert(all.end(), kCommon.begin(), kCommon.end());
  return all;
}

void read_common(const Session& session, lua_State* L, const Fields& fields, scene::ObjectSpec& object) {
  fields.require("position");
  fields.read("position", object.position);
  fields.read("orientation", object.orientation);
  fields.read("velocity", object.velocity);
  fields.read("angular_velocity", object.angular_velocity);
  fields.read("mass", object.mass);
  fields.read("fixed", object.fixed);
  fields.read("colour", object.colour);
  fields.read("pole", object.pole);
  fields.read("moment", object.moment);
  fields.with("material",
              [&](int i, const std::string& name) { object.material = material_at(session, L, i, name); });
  fields.with("label", [&](int i, const std::string& name) {
    object.label = text_at(L, i, name);
    if (object.label.size() > kLongestLabel || one_line(object.label) != object.label)
      must_be(L, i, name, "at most 100 characters in one line");
  });
}

void read_radius(Session&, lua_State*, const Fields& fields, scene::ObjectSpec& object) {
  fields.require("radius");
  fields.read("radius", object.radius);
}

void read_round(Session& session, lua_State* L, const Fields& fields, scene::ObjectSpec& object) {
  read_radius(session, L, fields, object);
  fields.require("height");
  fields.read("height", object.height);
}

void read_size(Session&, lua_State*, const Fields& fields, scene::ObjectSpec& object) {
  fields.require("size");
  fields.read("size", object.size);
}

scene::SolidSource& solids(const Session& session) {
  if (!session.options.solids) throw Problem("hull and mesh are not available to a script loaded this way");
  return *session.options.solids;
}

// Where the script's author sees it, once.
void tell(const Session& session, lua_State* L, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) {
    const std::string line = session.interpreter->place(L) + ": " + note;
    if (session.options.note)
      session.options.note(line);
    else
      std::fprintf(stderr, "%s\n", line.c_str());
  }
}

// `make` throws a clause without the field that it is about.
template <typename Make>
std::shared_ptr<const scene::Solid> make_solid(const Session& session, lua_State* L, const std::string& field,
                                               Make make) {
  scene::SolidAnswer answer;
  try {
    answer = make();
  } catch (const scene::InputError& e) {
    throw Problem(field + e.what());
  }
  tell(session, L, answer.notes);
  return answer.solid;
}

void read_file(const Session& session, lua_State* L, const Fields& fields, scene::MeshRequest& request) {
  fields.with("file", [&](int i, const std::string& name) {
    const std::string path = text_at(L, i, name);
    request.file = readable_file(session, name, path);
    request.name = one_line(path);
  });
  fields.with("scale", [&](int i, const std::string& name) {
    request.scale = number_at(L, i, name);
    if (!(request.scale >= 1e-9 && request.scale <= 1e9)) must_be(L, i, name, "in [1e-09, 1e+09]");
  });
}

void read_mesh(Session& session, lua_State* L, const Fields& fields, scene::ObjectSpec& object) {
  scene::MeshRequest request;
  fields.require("file");
  read_file(session, L, fields, request);
  fields.read("decompose", request.decompose);
  fields.read("pieces", request.pieces, 1, kMostPieces);
  fields.with("tolerance", [&](int i, const std::string& name) {
    request.tolerance = number_at(L, i, name);
    if (!(request.tolerance > 0.0)) must_be(L, i, name, "greater than 0");
  });
  object.solid = make_solid(session, L, "mesh.file = ", [&] { return solids(session).mesh(request); });
}

std::vector<Eigen::Vector3d> points_at(Session& session, lua_State* L, int index, const std::string& name) {
  if (lua_type(L, index) != LUA_TTABLE) must_be(L, index, name, "a list of points, {{x, y, z}, ...}");
  const lua_Unsigned count = lua_rawlen(L, index);
  if (count > kMostPoints) throw Problem(name + ": more than 100000 points");
  session.interpreter->charge(L, count);
  std::vector<Eigen::Vector3d> points;
  for (lua_Unsigned i = 1; i <= count; ++i) {
    lua_rawgeti(L, index, static_cast<lua_Integer>(i));
    points.push_back(vector_at(L, lua_gettop(L), name + "[" + std::to_string(i) + "]"));
    lua_pop(L, 1);
  }
  return points;
}

void read_hull(Session& session, lua_State* L, const Fields& fields, scene::ObjectSpec& object) {
  if (fields.has("points") == fields.has("file"))
    throw Problem("hull: takes points = {{x, y, z}, ...} or file = 'part.stl', one of them");
  if (fields.has("file")) {
    scene::MeshRequest request;
    read_file(session, L, fields, request);
    object.solid = make_solid(session, L, "hull.file = ", [&] { return solids(session).hull(request); });
    return;
  }
  if (fields.has("scale")) throw Problem("hull.scale: goes with file; the points are in u");
  fields.with("points", [&](int i, const std::string& name) {
    const std::vector<Eigen::Vector3d> points = points_at(session, L, i, name);
    object.solid = make_solid(session, L, name + ": ", [&] { return solids(session).hull(points, "hull"); });
  });
}

constexpr Shape kSphere{"sphere", scene::ShapeKind::kSphere, {"radius"}, read_radius};
constexpr Shape kBox{"box", scene::ShapeKind::kBox, {"size"}, read_size};
constexpr Shape kCylinder{"cylinder", scene::ShapeKind::kCylinder, {"radius", "height"}, read_round};
constexpr Shape kCapsule{"capsule", scene::ShapeKind::kCapsule, {"radius", "height"}, read_round};
constexpr Shape kCone{"cone", scene::ShapeKind::kCone, {"radius", "height"}, read_round};
constexpr Shape kHull{"hull", scene::ShapeKind::kSolid, {"points", "file", "scale"}, read_hull};
constexpr Shape kMesh{
    "mesh", scene::ShapeKind::kSolid, {"file", "scale", "decompose", "pieces", "tolerance"}, read_mesh};

// Id numbers are those of recordings and of the view: from 0, in the order of creation.
scene::ObjectId add(Session& session, const Shape& shape, const scene::ObjectSpec& object) {
  const std::string what(shape.name);
  if (const std::string problem = problem_with(object); !problem.empty()) throw Problem(what + "." + problem);
  if (session.phase == Phase::kRunning) return session.host->spawn(object);
  auto& objects = session.spec.objects;
  if (objects.size() >= kMostObjects) throw Problem(what + ": more than 1000000 objects");
  objects.push_back(object);
  return static_cast<scene::ObjectId>(objects.size() - 1);
}

template <const Shape& shape>
int create(Session& session, lua_State* L) {
  static const std::vector<std::string_view> known = fields_of(shape);
  const Fields fields(L, 1, std::string(shape.name), known);
  scene::ObjectSpec object;
  object.shape = shape.kind;
  shape.read(session, L, fields, object);
  read_common(session, L, fields, object);
  lua_pushinteger(L, static_cast<lua_Integer>(add(session, shape, object)));
  return 1;
}

template <const Shape& shape>
void bind(lua_State* L) {
  lua_register(L, shape.name.data(), (guarded<create<shape>>));
}

}  // namespace

void bind_objects(lua_State* L) {
  bind<kSphere>(L);
  bind<kBox>(L);
  bind<kCylinder>(L);
  bind<kCapsule>(L);
  bind<kCone>(L);
  bind<kHull>(L);
  bind<kMesh>(L);
}

}  // namespace smartsurf::script
