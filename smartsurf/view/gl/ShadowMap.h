// The shadow map of the sun, fitted to the lit region. Internal to
// smartsurf/view.
#pragma once

#include <Eigen/Geometry>

#include "smartsurf/view/gl/GlObjects.h"

namespace smartsurf::view {

class ShadowMap {
 public:
  // size: edge of the map, texels. Throws std::runtime_error if the driver refuses it.
  explicit ShadowMap(int size);

  // Fits the light's projection to `box` (u) and the penumbra to the surface's pitch (u).
  void fit(const Eigen::AlignedBox3d& box, double pitch);
  Eigen::Matrix4f clip_from_world() const { return clip_from_world_.cast<float>(); }
  Eigen::Matrix4f texture_from_world() const;
  double texel_size() const { return texel_size_; }            // edge of a texel, u
  double penumbra_radius() const { return penumbra_radius_; }  // of contact, u
  // How much wider the penumbra becomes, u, per unit of the map's depth between a point and what shades it.
  double penumbra_spread() const;
  // x and y bounds, u, of the fitted box and its shadow on a horizontal plane at z, which lies below the box.
  Eigen::AlignedBox2d shadow_footprint(double z) const;

  void begin() const;  // binds and clears the map; draws until end() go into it
  void end() const;
  void bind(int unit) const;  // for comparisons
  void bind_depths(int unit) const;

 private:
  int size_;
  Texture depth_;
  Sampler depth_sampler_;  // without the comparison
  Framebuffer framebuffer_;
  Eigen::Matrix4d clip_from_world_ = Eigen::Matrix4d::Identity();
  Eigen::AlignedBox3d fitted_box_;
  double texel_size_ = 1.0, penumbra_radius_ = 1.0, depth_range_ = 1.0;
};

}  // namespace smartsurf::view
