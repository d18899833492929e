#include "smartsurf/view/model/Camera.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "smartsurf/scene/SurfaceBounds.h"
#include "smartsurf/view/model/Axes.h"
#include "smartsurf/view/model/TableBounds.h"

namespace smartsurf::view {
namespace {

constexpr double kOrbitPerPixel = 0.006;  // rad
constexpr double kZoomPerNotch = 0.88;    // distance factor
constexpr double kFramingMargin = 1.06;   // frustum width over table width
constexpr double kIsoElevation = 0.70;    // rad, 40°
constexpr double kSideElevation = 0.10;   // rad

std::array<Eigen::Vector3d, 8> corners(const Eigen::AlignedBox3d& box) {
  std::array<Eigen::Vector3d, 8> result;
  for (int i = 0; i < 8; ++i)
    result[i] = {(i & 1) ? box.max().x() : box.min().x(), (i & 2) ? box.max().y() : box.min().y(),
                 (i & 4) ? box.max().z() : box.min().z()};
  return result;
}

// Fits two opposite frustum planes (left and right, or bottom and top) to points. With the eye at (e, d), d
// towards the viewer, a point (p, z) is inside if |p − e| ≤ slope·(d − z). distance() is the smallest d for
// which some e satisfies this for all points; offset() is the middle of those e.
struct FrustumFit {
  double slope;
  double low = -std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void add(double p, double z) {
    high = std::max(high, p + slope * z);
    low = std::max(low, -p + slope * z);
  }
  double distance() const { return (high + low) / (2.0 * slope); }
  double offset() const { return 0.5 * (high - low); }
};

// Clamps a quantity that changes; one that is out of the limits before may stay, but goes no farther out.
double clamp_change(double before, double after, double low, double high) {
  return std::clamp(after, std::min(low, before), std::max(high, before));
}

// "X,Y,Z" with finite numbers.
std::optional<Eigen::Vector3d> parse_point(std::string_view text) {
  Eigen::Vector3d point;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (int axis = 0; axis < 3; ++axis) {
    if (axis > 0 && (at == end || *at++ != ',')) return std::nullopt;
    const auto [rest, error] = std::from_chars(at, end, point[axis]);
    if (error != std::errc{} || !std::isfinite(point[axis])) return std::nullopt;
    at = rest;
  }
  return at == end ? std::optional(point) : std::nullopt;
}

}  // namespace

std::string to_string(const CameraPose& pose) {
  char text[160];
  const Eigen::Vector3d &p = pose.position, &t = pose.target;
  std::snprintf(text, sizeof text, "%.6g,%.6g,%.6g:%.6g,%.6g,%.6g", p.x(), p.y(), p.z(), t.x(), t.y(), t.z());
  return text;
}

std::optional<CameraPose> parse_camera_pose(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == text.npos) return std::nullopt;
  const auto position = parse_point(text.substr(0, colon)), target = parse_point(text.substr(colon + 1));
  if (!position || !target || !(position->z() > target->z())) return std::nullopt;
  return CameraPose{*position, *target};
}

Camera Camera::fit_to_surface(const scene::SurfaceSpec& surface, CameraPreset preset, double aspect,
                              std::span<const Eigen::Vector3d> also) {
  Camera camera;
  camera.azimuth_ = 0.0;
  camera.elevation_ = preset == CameraPreset::kTop   ? kMaxElevation
                      : preset == CameraPreset::kIso ? kIsoElevation
                                                     : kSideElevation;
  const Eigen::AlignedBox3d box = surface_bounding_box(surface);
  camera.scene_centre_ = box.center();
  camera.scene_radius_ = 0.5 * box.diagonal().norm();
  const double k_y = std::tan(camera.field_of_view_ / 2.0) / kFramingMargin;
  const double k_x = k_y * aspect;
  FrustumFit x{k_x}, y{k_y};
  const auto include = [&](const Eigen::Vector3d& point) {
    const double depth = -point.dot(camera.forward());
    x.add(point.dot(camera.right()), depth);
    y.add(point.dot(camera.up()), depth);
  };
  for (const Eigen::Vector3d& corner : corners(box)) include(corner);
  const double margin = kBoardMargin * surface.pitch;
  Eigen::AlignedBox3d board(box.min() - Eigen::Vector3d(margin, margin, 0.0), box.min());
  board.extend(Eigen::Vector3d(box.max().x() + margin, box.max().y() + margin, box.min().z()));
  for (const Eigen::Vector3d& corner : corners(board)) include(corner);
  const Axes axes = make_axes(surface);
  include(axes.origin);
  for (int i = 0; i < 3; ++i) include(axes.origin + axes.length * Eigen::Vector3d::Unit(i));
  for (const Eigen::Vector3d& point : also) include(point);
  const double eye_depth = std::max(x.distance(), y.distance());
  const double target_depth = -box.center().dot(camera.forward());
  camera.distance_ = camera.reference_distance_ = eye_depth - target_depth;
  camera.target_ = camera.right() * x.offset() + camera.up() * y.offset() - camera.forward() * target_depth;
  return camera;
}

Camera Camera::from_view(const scene::SurfaceSpec& surface, const CameraView& view, double aspect,
                         std::span<const Eigen::Vector3d> also) {
  Camera camera =
      fit_to_surface(surface, view.preset, aspect, view.pose ? std::span<const Eigen::Vector3d>{} : also);
  if (view.pose) camera.set_pose(*view.pose);
  return camera;
}

// Straight down, the azimuth stays.
void Camera::set_pose(const CameraPose& pose) {
  const Eigen::Vector3d offset = pose.position - pose.target;
  const double across = offset.head<2>().norm();
  if (across > 1e-9 * offset.norm()) azimuth_ = std::atan2(offset.x(), -offset.y());
  elevation_ = std::atan2(offset.z(), across);
  distance_ = offset.norm();
  target_ = pose.target;
}

void Camera::orbit(double dx, double dy) {
  azimuth_ = std::remainder(azimuth_ - dx * kOrbitPerPixel, 2.0 * std::numbers::pi);
  elevation_ = clamp_change(elevation_, elevation_ + dy * kOrbitPerPixel, kMinElevation, kMaxElevation);
}

void Camera::pan(double dx, double dy, double height) {
  const double per_pixel = 2.0 * distance_ * std::tan(field_of_view_ / 2.0) / std::max(height, 1.0);
  target_ += (up() * dy - right() * dx) * per_pixel;
}

void Camera::zoom(double notches) {
  distance_ = clamp_change(distance_, distance_ * std::pow(kZoomPerNotch, notches),
                           reference_distance_ / 200.0, reference_distance_ * 5.0);
}

Eigen::Vector3d Camera::forward() const {
  const double c = std::cos(elevation_);
  return {-c * std::sin(azimuth_), c * std::cos(azimuth_), -std::sin(elevation_)};
}

Eigen::Vector3d Camera::right() const { return {std::cos(azimuth_), std::sin(azimuth_), 0.0}; }

Eigen::Vector3d Camera::up() const { return right().cross(forward()); }

Eigen::Vector3d Camera::eye() const { return target_ - forward() * distance_; }

Eigen::Matrix4d Camera::view_matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.block<1, 3>(0, 0) = right().transpose();
  m.block<1, 3>(1, 0) = up().transpose();
  m.block<1, 3>(2, 0) = -forward().transpose();
  m.block<3, 1>(0, 3) = -m.block<3, 3>(0, 0) * eye();
  return m;
}

Eigen::Matrix4d Camera::projection_matrix(double aspect) const {
  // The planes follow the distances of the target and of the table: close-ups are not clipped, and distant
  // views keep their depth precision.
  const double table = (eye() - scene_centre_).norm();
  const double near_plane = std::max(0.02 * distance_, std::min(distance_, table) - 8.0 * scene_radius_);
  const double far_plane = std::max(distance_, table) + 20.0 * scene_radius_;
  const double f = 1.0 / std::tan(field_of_view_ / 2.0);
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m(0, 0) = f / aspect;
  m(1, 1) = f;
  m(2, 2) = (far_plane + near_plane) / (near_plane - far_plane);
  m(2, 3) = 2.0 * far_plane * near_plane / (near_plane - far_plane);
  m(3, 2) = -1.0;
  return m;
}

Eigen::Vector3d Camera::project(const Eigen::Vector3d& point, double width, double height) const {
  const Eigen::Vector4d clip = projection_matrix(width / height) *
                               (view_matrix() * Eigen::Vector4d(point.x(), point.y(), point.z(), 1.0));
  return {(clip.x() / clip.w() + 1.0) * 0.5 * width, (1.0 - clip.y() / clip.w()) * 0.5 * height, clip.w()};
}

Camera::PixelRays Camera::rays(double width, double height) const {
  return {eye(), forward(), right(), up(), std::tan(field_of_view_ / 2.0), width, height};
}

}  // namespace smartsurf::view
