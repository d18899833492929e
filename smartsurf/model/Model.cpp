#include "smartsurf/model/Model.h"

namespace smartsurf::model {

Inertial combined(const Inertial& a, const Inertial& b) {
  Inertial out;
  out.mass = a.mass + b.mass;
  if (!(out.mass > 0.0)) return out;
  out.centre_of_mass = (a.mass * a.centre_of_mass + b.mass * b.centre_of_mass) / out.mass;
  for (const Inertial* part : {&a, &b}) {  // the parallel axis theorem
    const Eigen::Vector3d d = part->centre_of_mass - out.centre_of_mass;
    out.inertia +=
        part->inertia + part->mass * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
  }
  return out;
}

Inertial transformed(const Pose& pose, const Inertial& inertial) {
  const Eigen::Matrix3d axes = pose.orientation.toRotationMatrix();
  return {inertial.mass, pose * inertial.centre_of_mass, axes * inertial.inertia * axes.transpose()};
}

}  // namespace smartsurf::model
