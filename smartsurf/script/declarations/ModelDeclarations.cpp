// urdf, mjcf: the bodies and joints of a robot description as objects and joints.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/model/Model.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/declarations/Creation.h"
#include "smartsurf/script/lua/SandboxFiles.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

using model::Geometry;
using model::Inertial;
using model::Pose;
using scene::ShapeKind;

constexpr int kMeridians = 20, kRings = 9, kPrismSides = 32;

struct Placement {
  Pose base;                     // of the model's frame
  double scale = 1.0;            // u per unit of the file
  std::filesystem::path folder;  // of the file, as the script names it
  int material = 0;
};

void scale_lengths(Pose& pose, double scale) { pose.position *= scale; }

void scale_lengths(model::Model& m, double s) {
  for (model::Body& body : m.bodies) {
    scale_lengths(body.pose, s);
    body.inertial.centre_of_mass *= s;
    body.inertial.inertia *= s * s;
    for (Geometry& g : body.geometries) {
      scale_lengths(g.pose, s);
      g.radius *= s, g.height *= s, g.size *= s, g.mesh_scale *= s;
      if (g.density) *g.density /= s * s * s;
    }
  }
  for (model::Joint& j : m.joints) {
    scene::JointSpec& spec = j.spec;
    const bool is_slider = spec.kind == scene::JointKind::kSlider;
    const double coordinate = is_slider ? s : 1.0, rate = is_slider ? 1.0 : s * s;
    spec.anchor *= s;
    if (spec.limits) spec.limits->lower *= coordinate, spec.limits->upper *= coordinate;
    spec.friction *= rate * coordinate;
    if (spec.spring)
      spec.spring->stiffness *= rate, spec.spring->damping *= rate, spec.spring->rest *= coordinate;
  }
}

// A geometry as an object whose origin has `pose` in the frame of the body.
struct PlacedObject {
  scene::ObjectSpec object;
  Pose pose;
};

PlacedObject make_placed(const ScriptContext& context, lua_State* L, const Geometry& g, const Placement& at) {
  PlacedObject one{{}, g.pose};
  scene::ObjectSpec& o = one.object;
  o.shape = g.shape;
  o.radius = g.radius;
  o.height = g.height;
  o.size = g.size;
  if (g.shape == ShapeKind::kSolid) {
    scene::MeshRequest request;
    request.file = resolve_readable_path(context, g.where, (at.folder / g.mesh_file).string());
    request.display_name = to_single_line(g.mesh_file);
    request.scale = g.mesh_scale;
    o.solid = make_solid(context, L, g.where + ": ",
                         [&](scene::SolidFactory& factory) { return factory.load_mesh(request); });
    one.pose.position = g.pose * o.solid->centroid;
  }
  throw_if_invalid(validate(o), g.where + ": ");
  return one;
}

// The inertial of a geometry in the frame of the body.
Inertial inertial_of(const ScriptContext& context, const Geometry& g, const PlacedObject& one,
                     const Placement& at) {
  const double density = g.density.value_or(context.spec.materials[at.material].density);
  const double mass = g.mass.value_or(density * one.object.volume());
  if (!(mass >= 0.0)) throw ScriptError(g.where + ": its mass must not be negative");
  return transformed(one.pose, {mass, Eigen::Vector3d::Zero(), one.object.homogeneous_inertia(mass)});
}

// Points whose convex hulls are the object, in the frame of the body. Round shapes become inscribed
// polyhedra.
void append_hulls(const PlacedObject& one, std::vector<std::vector<Eigen::Vector3d>>& hulls) {
  const scene::ObjectSpec& o = one.object;
  std::vector<Eigen::Vector3d> points;
  const Eigen::Vector3d half = o.half_extents();
  const double straight = o.shape == ShapeKind::kCapsule ? half.z() - o.radius : 0.0;
  auto add_circle = [&](double radius, double z, int count) {
    for (int i = 0; i < count; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / count;
      points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
  };
  switch (o.shape) {
    case ShapeKind::kSolid:
      for (const scene::ConvexHull& hull : o.solid->hulls) {
        auto& corners = hulls.emplace_back();
        for (const Eigen::Vector3f& corner : hull.vertices)
          corners.push_back(one.pose * Eigen::Vector3d(corner.cast<double>()));
      }
      return;
    case ShapeKind::kBox:
      for (int i = 0; i < 8; ++i)
        points.emplace_back((i & 1 ? 1 : -1) * half.x(), (i & 2 ? 1 : -1) * half.y(),
                            (i & 4 ? 1 : -1) * half.z());
      break;
    case ShapeKind::kCylinder:
      for (const double end : {-half.z(), half.z()}) add_circle(o.radius, end, kPrismSides);
      break;
    case ShapeKind::kSphere:
    case ShapeKind::kCapsule:
      for (int ring = 1; ring <= kRings; ++ring) {
        const double latitude = std::numbers::pi * (static_cast<double>(ring) / (kRings + 1) - 0.5);
        add_circle(o.radius * std::cos(latitude),
                   o.radius * std::sin(latitude) + std::copysign(straight, latitude), kMeridians);
      }
      for (const double pole : {-1.0, 1.0}) points.emplace_back(0.0, 0.0, pole * (o.radius + straight));
      break;
    case ShapeKind::kCone:
      break;  // neither format has one
  }
  for (Eigen::Vector3d& p : points) p = one.pose * p;
  hulls.push_back(std::move(points));
}

PlacedObject join_placed(const ScriptContext& context, lua_State* L, const std::vector<PlacedObject>& placed,
                         const std::string& where) {
  if (placed.size() == 1) return placed.front();
  std::vector<std::vector<Eigen::Vector3d>> hulls;
  for (const PlacedObject& one : placed) append_hulls(one, hulls);
  PlacedObject joined;
  joined.object.shape = ShapeKind::kSolid;
  joined.object.solid = make_solid(context, L, where + ": ", [&](scene::SolidFactory& factory) {
    return factory.make_compound(hulls, "geometry");
  });
  joined.pose.position = joined.object.solid->centroid;
  return joined;
}

// The body's mass properties, in the axes of the object about its origin.
void set_inertial(const model::Body& body, const Inertial& total, const Pose& pose, scene::ObjectSpec& o) {
  if (!(total.mass > 0.0))
    throw ScriptError(body.where + ": has no mass: give it an inertial, or a geometry with a mass");
  const Eigen::Quaterniond back = pose.orientation.conjugate();
  const Inertial local = transformed({-(back * pose.position), back}, total);
  o.mass = total.mass;
  o.inertia = 0.5 * (local.inertia + local.inertia.transpose());
  o.centre_of_mass = local.centre_of_mass;
  if (o.centre_of_mass.norm() < 1e-7 * o.half_extents().norm()) o.centre_of_mass.setZero();
}

// Nothing for the table itself.
std::optional<scene::ObjectId> add_body(ScriptContext& context, lua_State* L, const model::Body& body,
                                        const Placement& at) {
  if (body.geometries.empty()) {
    if (body.fixed) return std::nullopt;
    throw ScriptError(body.where + ": has no geometry: give it a shape, or weld it to another body");
  }
  const bool any_collides = std::ranges::any_of(body.geometries, &Geometry::collides);
  std::vector<PlacedObject> placed;
  Inertial total = body.inertial;
  scene::ObjectSpec look;
  for (const Geometry& g : body.geometries) {
    PlacedObject one = make_placed(context, L, g, at);
    if (g.has_mass) total = combined(total, inertial_of(context, g, one, at));
    if (!look.friction) look.friction = g.friction;
    if (g.collides || !any_collides) placed.push_back(std::move(one));
  }
  PlacedObject whole = join_placed(context, L, placed, body.where);
  scene::ObjectSpec& o = whole.object;
  o.friction = look.friction;
  o.fixed = body.fixed;
  o.material = at.material;
  o.label = body.names.front();
  if (!is_label(o.label)) throw ScriptError(body.where + ": the name must be " + kLabelRule);
  for (const Geometry& g : body.geometries)
    if (g.colour) {
      o.colour = *g.colour;
      break;
    }
  if (!body.fixed) set_inertial(body, total, whole.pose, o);
  const Pose pose = at.base * body.pose * whole.pose;
  o.position = pose.position;
  o.orientation = pose.orientation.normalized();
  throw_if_invalid(validate(o), body.where + ": ");
  return add_object(context, body.where, o);
}

void set_id(lua_State* L, const std::string& name, std::uint32_t id) {
  lua_pushlstring(L, name.data(), name.size());
  lua_pushinteger(L, static_cast<lua_Integer>(id));
  lua_rawset(L, -3);
}

// Leaves {objects = {name = id}, joints = {name = id}} on the stack.
void add_model(ScriptContext& context, lua_State* L, const model::Model& m, const Placement& at) {
  lua_createtable(L, 0, 2);
  lua_createtable(L, 0, static_cast<int>(m.bodies.size()));
  std::vector<std::optional<scene::ObjectId>> ids;
  for (const model::Body& body : m.bodies) {
    ids.push_back(add_body(context, L, body, at));
    if (!ids.back()) continue;
    for (const std::string& name : body.names) set_id(L, name, *ids.back());
  }
  lua_setfield(L, -2, "objects");
  lua_createtable(L, 0, static_cast<int>(m.joints.size()));
  for (const model::Joint& joint : m.joints) {
    scene::JointSpec spec = joint.spec;
    const auto a = ids[spec.a];
    if (spec.b) spec.b = ids[*spec.b];
    if (!a) throw ScriptError(joint.where + ": moves the table");
    spec.a = *a;
    spec.anchor = at.base * spec.anchor;
    spec.axis = at.base.orientation * spec.axis;
    try {
      set_id(L, joint.name, add_joint(context, spec));
    } catch (const ScriptError& e) {
      throw ScriptError(joint.where + ": " + e.what());
    }
  }
  lua_setfield(L, -2, "joints");
}

NamedFile read_model_file(ScriptContext& context, lua_State* L, const TableReader& fields, Placement& at) {
  NamedFile file;
  fields.require("file");
  fields.require("position");
  fields.visit("file", [&](int i, const std::string& name) {
    const std::string path = check_string(L, i, name);
    file = read_sandboxed_file(context, name, path);
    at.folder = std::filesystem::path(path).parent_path();
  });
  context.interpreter->charge(L, file.content.size() / kBytesPerInstruction);
  return file;
}

Placement read_placement(const ScriptContext& context, lua_State* L, const TableReader& fields) {
  Placement at;
  fields.read("position", at.base.position);
  fields.read("orientation", at.base.orientation);
  fields.visit("scale", [&](int i, const std::string& name) {
    at.scale = check_number(L, i, name);
    if (!(at.scale >= 1e-9 && at.scale <= 1e9)) throw_invalid_value(L, i, name, "in [1e-09, 1e+09]");
  });
  double metres = 1.0;
  fields.visit("unit", [&](int i, const std::string& name) {
    metres = check_physical_unit(L, i, name).metres;
    if (!context.spec.world.unit)
      throw ScriptError(name + ": the world has no unit; declare it before, as in world{unit = 'mm'}");
  });
  if (context.spec.world.unit) at.scale *= metres / context.spec.world.unit->metres;
  fields.visit("material",
               [&](int i, const std::string& name) { at.material = check_material(context, L, i, name); });
  return at;
}

template <class Read>
int create_model(ScriptContext& context, lua_State* L, const TableReader& fields, Read read) {
  Placement at = read_placement(context, L, fields);
  const NamedFile file = read_model_file(context, L, fields, at);
  model::Model m;
  try {
    m = read(file);
  } catch (const scene::InputError& e) {
    throw ScriptError(e.what());
  }
  scale_lengths(m, at.scale);
  add_model(context, L, m, at);
  return 1;
}

int urdf(ScriptContext& context, lua_State* L) {
  const TableReader fields(L, 1, "urdf",
                           {"file", "position", "orientation", "unit", "scale", "material", "fixed"});
  bool fixed = false;
  fields.read("fixed", fixed);
  return create_model(context, L, fields, [fixed](const NamedFile& file) {
    return model::read_urdf(file.content, file.name, fixed);
  });
}

int mjcf(ScriptContext& context, lua_State* L) {
  const TableReader fields(L, 1, "mjcf", {"file", "position", "orientation", "unit", "scale", "material"});
  return create_model(context, L, fields,
                      [](const NamedFile& file) { return model::read_mjcf(file.content, file.name); });
}

}  // namespace

void bind_models(lua_State* L) {
  lua_register(L, "urdf", guarded<urdf>);
  lua_register(L, "mjcf", guarded<mjcf>);
}

}  // namespace smartsurf::script
