// Robot descriptions: URDF and MJCF files as bodies and joints, in the file's own units.
//
// Bodies that the file welds together are one body here. Unknown elements and attributes without a meaning
// for rigid bodies are ignored, as both formats want; docs/models.md lists what is read, what is ignored and
// what is refused.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::model {

struct Pose {
  Eigen::Vector3d position{0.0, 0.0, 0.0};
  Eigen::Quaterniond orientation{1.0, 0.0, 0.0, 0.0};

  Pose operator*(const Pose& local) const {
    return {position + orientation * local.position, orientation * local.orientation};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return position + orientation * point; }
  // A pose of the same frame as this one, as seen from here.
  Pose to_local(const Pose& other) const {
    const Eigen::Quaterniond back = orientation.conjugate();
    return {back * (other.position - position), back * other.orientation};
  }
};

struct Geometry {
  std::string where;  // "FILE:LINE: <element name='…'>", for messages
  // kSolid: a mesh. Others have the fields and axes of scene::ObjectSpec.
  scene::ShapeKind shape = scene::ShapeKind::kSphere;
  double radius = 0.0, height = 0.0;
  Eigen::Vector3d size{0.0, 0.0, 0.0};
  std::string mesh_file;  // relative to the folder of the file
  double mesh_scale = 1.0;
  Pose pose;                            // in the frame of the body
  bool collides = true;                 // else it counts for the inertia alone
  bool has_mass = true;                 // whether it counts for the inertia
  std::optional<double> mass, density;  // density counts without mass; without either the material's
  std::optional<double> friction;
  std::optional<scene::Colour> colour;
};

struct Inertial {
  double mass = 0.0;
  Eigen::Vector3d centre_of_mass{0.0, 0.0, 0.0};      // in the frame of the body
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre of mass, axes of the body
};

struct Body {
  std::string where;
  std::vector<std::string> names;  // its own, and those of the bodies welded to it
  Pose pose;                       // in the frame of the model, every joint at 0
  bool fixed = false;              // to the table; without geometries it is the table
  std::vector<Geometry> geometries;
  Inertial inertial;  // besides that of the geometries
};

struct Joint {
  std::string where, name;
  // Objects are indices of bodies, anchor and axis in the frame of the model.
  scene::JointSpec spec;
};

struct Model {
  std::string name;
  std::vector<Body> bodies;  // a parent before its children
  std::vector<Joint> joints;
};

// `file` names the file in messages. All throw scene::InputError, one line that begins with "FILE:LINE".
// fixed_root: whether the root link of a URDF file is fixed to the table.
Model read_urdf(const std::string& text, const std::string& file, bool fixed_root);
Model read_mjcf(const std::string& text, const std::string& file);

// Both inertias as that of one body.
Inertial combined(const Inertial&, const Inertial&);
// The inertial in the frame in which its own frame has the pose.
Inertial transformed(const Pose&, const Inertial& inertial);

}  // namespace smartsurf::model
