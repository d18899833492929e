#include "smartsurf/surface/SkinShape.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::surface {
namespace {

// z of a tilted top at a distance from its centre, relative to it, u.
float height_on_top(const TopTilt& tilt, float dx, float dy) {
  const float cos_roll = std::cos(tilt.roll);
  const Eigen::Vector3f normal(cos_roll * std::sin(tilt.pitch), -std::sin(tilt.roll),
                               cos_roll * std::cos(tilt.pitch));
  return -(normal.x() * dx + normal.y() * dy) / normal.z();
}

int nearest(float u, int count) { return std::clamp(static_cast<int>(std::lround(u)), 0, count - 1); }

// True if the cell holds the nodes over its whole top, false if it holds one at its highest point.
bool is_flat(const Field& field, std::size_t cell) {
  if (!field.has_tips() || field.tip_of_cell[cell] < 0) return true;
  const CellTip::Shape shape = field.tip_at(cell).shape;
  return shape == CellTip::Shape::kPlate || shape == CellTip::Shape::kRoundedSquare;
}

}  // namespace

SkinShape::SkinShape(const scene::SurfaceSpec& surface, Field& field) {
  init_geometry(surface, field);
  find_supports(surface, field);
  assign_cells(field);
  factorise(field.skin);
  Skin& s = field.skin;
  s.supports_move = true;
  commit(field);  // an elastic skin begins in the shape of a taut one
  s.supports_move = false;
  if (!s.is_elastic) return;
  s.support_height.assign(s.nodes(), kNoCellHeight);
  s.support_speed.assign(s.nodes(), 0.0F);
  s.held = s.is_clamped = std::vector<std::uint8_t>(s.nodes(), 0);
  for (const std::size_t node : clamped_)
    s.support_height[node] = s.height[node], s.held[node] = s.is_clamped[node] = 1;
  for (const Support& support : supports_)
    s.support_height[support.node] = s.height[support.node], s.held[support.node] = 1;
}

void SkinShape::init_geometry(const scene::SurfaceSpec& surface, Field& field) {
  const scene::SkinSpec& spec = *surface.skin;
  Skin& s = field.skin;
  const Eigen::AlignedBox2f extent = surface.skin_extent().cast<float>();
  s.rows = spec.rows, s.columns = spec.columns;
  s.west = extent.min().x();
  s.north = extent.max().y();
  s.spacing_x = extent.sizes().x() / static_cast<float>(s.columns - 1);
  s.spacing_y = extent.sizes().y() / static_cast<float>(s.rows - 1);
  s.is_elastic = spec.kind == scene::SkinSpec::Kind::kElastic;
  s.attached = spec.attached;
  s.tension = static_cast<float>(spec.tension);
  s.density = static_cast<float>(spec.density);
  s.damping = static_cast<float>(spec.damping);
  s.height.assign(s.nodes(), 0.0F);
  s.speed = s.impulse = s.height;
  s.covers.assign(field.height.size(), 0);
  for (int r = 0; r < field.rows; ++r)
    for (int c = 0; c < field.columns; ++c) s.covers[field.index(r, c)] = surface.is_under_skin(r, c) ? 1 : 0;
  values_.assign(s.nodes(), 0.0);
}

void SkinShape::find_supports(const scene::SurfaceSpec& surface, const Field& field) {
  const Skin& s = field.skin;
  std::vector<std::uint8_t> is_held(s.nodes(), 0);
  const auto is_edge = [&s](int r, int c) {
    return r == 0 || c == 0 || r + 1 == s.rows || c + 1 == s.columns;
  };
  edge_height_ = surface.skin->edge_height;
  if (surface.skin->edge == scene::SkinSpec::Edge::kClamped)
    for (int r = 0; r < s.rows; ++r)
      for (int c = 0; c < s.columns; ++c)
        if (is_edge(r, c)) clamped_.push_back(s.index(r, c)), is_held[s.index(r, c)] = 1;
  constexpr float kTolerance = 1e-4F;  // of the spacing
  for (std::size_t cell = 0; cell < field.height.size(); ++cell) {
    if (s.covers[cell] == 0 || !std::isfinite(field.height[cell])) continue;
    const Eigen::Vector2f centre = field.centre(static_cast<int>(cell));
    const float column = (centre.x() - s.west) / s.spacing_x, row = (s.north - centre.y()) / s.spacing_y;
    const bool flat = is_flat(field, cell);
    const float half_x = flat ? field.half_top_x / s.spacing_x + kTolerance : 0.0F,
                half_y = flat ? field.half_top_y / s.spacing_y + kTolerance : 0.0F;
    const auto add = [&](int r, int c) {
      const std::size_t node = s.index(r, c);
      if (is_held[node] != 0) return;
      is_held[node] = 1;
      supports_.push_back({node, cell, s.node(r, c).x() - centre.x(), s.node(r, c).y() - centre.y()});
    };
    bool any = false;
    for (int r = std::max(0, static_cast<int>(std::ceil(row - half_y)));
         r < s.rows && static_cast<float>(r) <= row + half_y; ++r)
      for (int c = std::max(0, static_cast<int>(std::ceil(column - half_x)));
           c < s.columns && static_cast<float>(c) <= column + half_x; ++c)
        add(r, c), any = true;
    if (!any) add(nearest(row, s.rows), nearest(column, s.columns));
  }
}

void SkinShape::assign_cells(Field& field) const {
  Skin& s = field.skin;
  s.cell_of_node.assign(s.nodes(), 0);
  std::vector<int> cells;
  const auto bears = [&](int cell) { return s.covers[cell] != 0 && std::isfinite(field.height[cell]); };
  for (int cell = 0; cell < field.cells(); ++cell)
    if (bears(cell)) cells.push_back(cell);
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c) {
      const Eigen::Vector2f at = s.node(r, c).head<2>();
      const int row = field.rows - 1 - nearest(at.y() / field.pitch, field.rows),
                column = nearest(at.x() / field.pitch, field.columns);
      const int under = field.index(row, column);
      s.cell_of_node[s.index(r, c)] =
          bears(under) ? under : *std::ranges::min_element(cells, {}, [&](int cell) {
            return (field.centre(cell) - at).squaredNorm();
          });
    }
}

void SkinShape::factorise(const Skin& s) {
  std::vector<Eigen::Index> unknown_of_node(s.nodes(), 0);
  for (const std::size_t node : clamped_) unknown_of_node[node] = -1;
  for (const Support& support : supports_) unknown_of_node[support.node] = -1;
  for (std::size_t node = 0; node < s.nodes(); ++node) {
    if (unknown_of_node[node] < 0) continue;
    unknown_of_node[node] = static_cast<Eigen::Index>(unknowns_.size());
    unknowns_.push_back(node);
  }
  const auto count = static_cast<Eigen::Index>(unknowns_.size());
  std::vector<Eigen::Triplet<double>> entries;
  for_each_edge(s, [&](std::size_t a, std::size_t b, double weight) {
    const Eigen::Index i = unknown_of_node[a], j = unknown_of_node[b];
    if (i >= 0) entries.emplace_back(i, i, weight);
    if (j >= 0) entries.emplace_back(j, j, weight);
    if (i >= 0 && j >= 0) entries.emplace_back(std::max(i, j), std::min(i, j), -weight);
    if (i >= 0 && j < 0) couplings_.push_back({i, b, weight});
    if (i < 0 && j >= 0) couplings_.push_back({j, a, weight});
  });
  Eigen::SparseMatrix<double> laplacian(count, count);
  laplacian.setFromTriplets(entries.begin(), entries.end());
  right_side_.assign(unknowns_.size(), 0.0);
  if (count == 0) return;
  factors_.analyse(laplacian);
  factors_.factorise(laplacian);
}

template <class Value>
void SkinShape::solve(Value value) noexcept {
  for (const Support& support : supports_) values_[support.node] = static_cast<double>(value(support));
  if (unknowns_.empty()) return;
  std::ranges::fill(right_side_, 0.0);
  for (const Coupling& c : couplings_) right_side_[c.unknown] += c.weight * values_[c.node];
  factors_.solve(right_side_);
  for (std::size_t i = 0; i < unknowns_.size(); ++i) values_[unknowns_[i]] = right_side_[i];
}

bool SkinShape::any_support_moves(const Field& field) const noexcept {
  if (field.max_speed == 0.0F) return false;
  return std::ranges::any_of(supports_, [&field](const Support& s) {
    return field.speed[s.cell] != 0.0F || (field.has_tilt() && !field.tilt_rate[s.cell].is_zero());
  });
}

void SkinShape::plan(double dt_s, Field& field) noexcept {
  Skin& s = field.skin;
  if (s.is_elastic)
    for (std::size_t i = 0; i < s.nodes(); ++i) {
      field.max_speed = std::max(field.max_speed, std::abs(s.speed[i]));
      field.max_height = std::max(field.max_height, s.height[i]);
    }
  const bool moves = any_support_moves(field);
  if (!moves && !s.supports_move) return;
  s.supports_move = moves;
  const auto dt = static_cast<float>(dt_s);
  const auto speed_of = [&](const Support& support) {
    float speed = field.speed[support.cell];
    if (!field.has_tilt()) return speed;
    const TopTilt &tilt = field.tilt[support.cell], &rate = field.tilt_rate[support.cell];
    if (rate.is_zero()) return speed;
    const TopTilt next{tilt.roll + dt * rate.roll, tilt.pitch + dt * rate.pitch};
    return speed +
           (height_on_top(next, support.dx, support.dy) - height_on_top(tilt, support.dx, support.dy)) / dt;
  };
  if (s.is_elastic) {
    for (const Support& support : supports_) s.support_speed[support.node] = speed_of(support);
    return;
  }
  for (const std::size_t node : clamped_) values_[node] = 0.0;
  solve(speed_of);
  // A taut skin is nowhere higher or faster than its supports, whose extremes the actuators have entered in
  // the field.
  std::ranges::transform(values_, s.speed.begin(), [](double v) { return static_cast<float>(v); });
}

void SkinShape::commit(Field& field) noexcept {
  Skin& s = field.skin;
  if (!s.supports_move) return;
  const auto height_of = [&field](const Support& support) {
    const float height = field.height[support.cell];
    return field.has_tilt() && !field.tilt[support.cell].is_zero()
               ? height + height_on_top(field.tilt[support.cell], support.dx, support.dy)
               : height;
  };
  if (s.is_elastic && !s.support_height.empty()) {
    for (const Support& support : supports_) s.support_height[support.node] = height_of(support);
    return;
  }
  for (const std::size_t node : clamped_) values_[node] = edge_height_;
  solve(height_of);
  std::ranges::transform(values_, s.height.begin(), [](double z) { return static_cast<float>(z); });
}

}  // namespace smartsurf::surface
