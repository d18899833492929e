// The shadow map: depth from a parallel light in the south-west, fitted to the lit region. Internal to this
// module.
#pragma once

#include <Eigen/Geometry>

#include "smartsurf/view/gl/GlObjects.h"

namespace smartsurf::view {

class ShadowMap {
 public:
  explicit ShadowMap(int size);

  static Eigen::Vector3d towards_light();  // unit vector

  void fit(const Eigen::AlignedBox3d& box, double pitch);
  Eigen::Matrix4f clip_from_world() const { return clip_from_world_.cast<float>(); }
  Eigen::Matrix4f texture_from_world() const;
  double texel_size() const { return texel_size_; }            // edge of one texel, u
  double penumbra_radius() const { return penumbra_radius_; }  // radius of the soft edge, u
  // Around all that the shadows of the fitted box reach on a plane at that height, below the box; x, y.
  Eigen::AlignedBox2d shadow_footprint(double z) const;

  void begin() const;  // binds and clears; what is drawn until end() throws shadows
  void end() const;
  void bind(int unit) const;

 private:
  int size_;
  Texture depth_;
  Framebuffer framebuffer_;
  Eigen::Matrix4d clip_from_world_ = Eigen::Matrix4d::Identity();
  Eigen::AlignedBox3d fitted_box_;
  double texel_size_ = 1.0, penumbra_radius_ = 1.0;
};

}  // namespace smartsurf::view
