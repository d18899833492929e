// A perspective orbit camera, defined by target, azimuth, elevation and distance.
//
// World axes: x east, y north, z up; lengths in u. No OpenGL. Functions of Camera neither allocate nor fail.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::view {

enum class CameraPreset { kTop, kIso, kSide };

// The position of a camera and the point in the middle of its image, u. Its text has the form "X,Y,Z:X,Y,Z".
struct CameraPose {
  Eigen::Vector3d position, target;
};
std::string to_string(const CameraPose& pose);
// Empty if the text does not have that form, or the position is not above the target.
std::optional<CameraPose> parse_camera_pose(std::string_view text);

// A camera that is yet to be fitted to a surface and an image.
struct CameraView {
  CameraPreset preset = CameraPreset::kIso;
  std::optional<CameraPose> pose;  // instead of the preset
};

// direction is a unit vector.
struct Ray {
  Eigen::Vector3d origin, direction;
};

class Camera {
 public:
  static constexpr double kMinElevation = 0.02;    // rad: never below the table
  static constexpr double kMaxElevation = 1.5700;  // rad: just short of straight down

  // The camera for which the whole table (the pins over their full travel, the board and the axes) fills an
  // image of aspect ratio `aspect` (width / height) with a small margin. kTop: from above, north up. kIso:
  // from the south, 40° above the horizon. kSide: from the south, just above the horizon.
  // It also sees the points `also`, for which it goes farther away where they need it.
  static Camera fit_to_surface(const scene::SurfaceSpec& surface, CameraPreset preset, double aspect,
                               std::span<const Eigen::Vector3d> also = {});

  // The view's pose, if it has one, with zoom() limited as for the preset; else fit_to_surface().
  static Camera from_view(const scene::SurfaceSpec& surface, const CameraView& view, double aspect,
                          std::span<const Eigen::Vector3d> also = {});

  // Rotates about the target. dx, dy: pointer movement, pixels, y down. The scene follows the pointer. The
  // elevation stays within kMinElevation … kMaxElevation, or where set_pose() has put it.
  void orbit(double dx, double dy);
  // Moves the target in the image plane so that it stays under the pointer. height: image height, pixels.
  void pan(double dx, double dy, double height);
  // Changes the distance by a constant factor per notch, > 0: closer. It stays within 1/200 … 5 times the
  // distance of fit_to_surface(), or where set_pose() has put it.
  void zoom(double notches);

  Eigen::Vector3d eye() const;
  Eigen::Vector3d target() const { return target_; }
  CameraPose pose() const { return {eye(), target_}; }
  // Moves the camera there, at any distance. Precondition: the position is above the target.
  void set_pose(const CameraPose& pose);
  Eigen::Vector3d forward() const;  // unit vector from the eye to the target
  Eigen::Vector3d right() const;
  Eigen::Vector3d up() const;
  double azimuth() const { return azimuth_; }      // rad; 0: south of the target, +π/2: east of it
  double elevation() const { return elevation_; }  // rad above the horizon
  double distance() const { return distance_; }
  double field_of_view() const { return field_of_view_; }  // vertical, rad

  // World to eye coordinates (x right, y up, view along −z).
  Eigen::Matrix4d view_matrix() const;
  // Eye to OpenGL clip coordinates (depth −1 … 1).
  Eigen::Matrix4d projection_matrix(double aspect) const;
  // The ray from the eye through pixel (x, y) of a width × height image; inverse of project().
  Ray ray(double x, double y, double width, double height) const { return rays(width, height).at(x, y); }
  // The rays of all pixels, without computing the camera's axes for each.
  struct PixelRays {
    Eigen::Vector3d eye, forward, right, up;
    double slope, width, height;  // slope: of the image's upper edge
    Ray at(double x, double y) const {
      const double across = (2.0 * x / width - 1.0) * slope * width / height,
                   upward = (1.0 - 2.0 * y / height) * slope;
      return {eye, (forward + across * right + upward * up).normalized()};
    }
  };
  PixelRays rays(double width, double height) const;
  // Moves the target; direction and distance stay.
  void look_at(const Eigen::Vector3d& target) { target_ = target; }
  // Pixel coordinates of a world point in a width × height image, y down from the top edge; z: depth along
  // forward(), u.
  Eigen::Vector3d project(const Eigen::Vector3d& point, double width, double height) const;

 private:
  Eigen::Vector3d target_{0.0, 0.0, 0.0};
  double azimuth_ = 0.0, elevation_ = 0.7, distance_ = 100.0;
  double field_of_view_ = 0.5;
  double reference_distance_ = 100.0;            // distance of fit_to_surface(); scales the zoom limits
  Eigen::Vector3d scene_centre_{0.0, 0.0, 0.0};  // of the table
  double scene_radius_ = 50.0;
};

}  // namespace smartsurf::view
