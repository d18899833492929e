// An orbiting perspective camera: looks at a target from an azimuth, an elevation and a distance.
//
// World axes: x east, y north, z up. No OpenGL here; every function is pure arithmetic, allocates nothing and
// cannot fail.
#pragma once

#include <Eigen/Geometry>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::view {

enum class CameraPreset { kTop, kIso, kSide };

// A half-line; the direction is a unit vector.
struct Ray {
  Eigen::Vector3d origin, direction;
};

// Shares of a picture's height that panels cover, from its edges; together at most 0.8.
struct ViewInsets {
  double bottom = 0.0;  // left free
  double top = 0.0;     // left free as far as that makes nothing smaller
  bool operator==(const ViewInsets&) const = default;
};

class Camera {
 public:
  static constexpr double kMinElevation = 0.02;    // rad: never below the table
  static constexpr double kMaxElevation = 1.5700;  // rad: just short of straight down

  // The whole table (its pins from the lowest to the highest place they can take, the board under them, and
  // the axes beside it) fills a picture of that aspect ratio (width / height) with a small margin. kTop has
  // north up; kIso looks north from the south at 40° above the horizon; kSide looks north from just above the
  // table.
  static Camera fit_to_surface(const scene::SurfaceSpec& surface, CameraPreset preset, double aspect,
                               const ViewInsets& insets = {});

  // The box of the table and its pins, u.
  static Eigen::AlignedBox3d surface_bounding_box(const scene::SurfaceSpec& surface);

  // dx, dy: pointer movement in pixels, y down. Dragging to the right turns the scene to the right.
  void orbit(double dx, double dy);
  // Moves the target in the picture's plane so that it stays under the pointer. height: of the picture,
  // pixels.
  void pan(double dx, double dy, double height);
  // notches > 0 comes closer, by the same factor each; the distance stays within 1/200 and 5 times the framed
  // one.
  void zoom(double notches);

  Eigen::Vector3d eye() const;
  Eigen::Vector3d target() const { return target_; }
  Eigen::Vector3d forward() const;  // unit vector from the eye to the target
  Eigen::Vector3d right() const;
  Eigen::Vector3d up() const;
  double azimuth() const { return azimuth_; }  // rad; 0 stands south of the target, +π/2 east of it
  double elevation() const { return elevation_; }
  double distance() const { return distance_; }
  double field_of_view() const { return field_of_view_; }  // vertical, rad

  // World → eye coordinates (x right, y up, looking along −z).
  Eigen::Matrix4d view_matrix() const;
  // Eye → clip coordinates as OpenGL has them (depth −1 … 1).
  Eigen::Matrix4d projection_matrix(double aspect) const;
  // The line of sight through that place of the picture, from the eye; the inverse of project().
  Ray ray(double x, double y, double width, double height) const;
  // Looks at another point from the same side and distance.
  void look_at(const Eigen::Vector3d& target) { target_ = target; }
  // Pixel of a world point in a picture of that size, y down from the top edge; z is the depth along
  // forward().
  Eigen::Vector3d project(const Eigen::Vector3d& point, double width, double height) const;

 private:
  Eigen::Vector3d target_{0.0, 0.0, 0.0};
  double azimuth_ = 0.0, elevation_ = 0.7, distance_ = 100.0;
  double field_of_view_ = 0.5;
  double reference_distance_ = 100.0;  // of the preset: the measure of zoom limits and of the clipping planes
  double scene_radius_ = 50.0;
};

}  // namespace smartsurf::view
