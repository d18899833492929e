#include "smartsurf/view/model/PinShading.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "smartsurf/view/model/Palette.h"

namespace smartsurf::view {
namespace {

constexpr float kOcclusionRange = 1.6f;   // an object darkens pins within this many radii
constexpr float kObjectOcclusion = 0.8f;  // strength of occlusion by objects
constexpr float kCosine60 = 0.5f, kSine60 = 0.8660254f;
constexpr float kCornerOcclusion = 0.62f;  // strength of occlusion by neighbouring pins

// Fraction of the sky that a wall hides from a point at its foot: 0 … 1. wall: its height in pitches.
float sky_occlusion(float wall) { return wall <= 0.0f ? 0.0f : wall / std::sqrt(1.0f + wall * wall); }

}  // namespace

int prisms_per_cell(const scene::SurfaceSpec& surface) { return surface.has_hexagonal_tops() ? 3 : 1; }

std::array<float, 2> prism_half_edges(const scene::SurfaceSpec& surface) {
  const auto half_x = static_cast<float>(surface.pin.top_x / 2.0);
  if (surface.has_hexagonal_tops()) return {half_x, half_x / std::numbers::sqrt3_v<float>};
  return {half_x, static_cast<float>(surface.pin.top_y / 2.0)};
}

PinShading::PinShading(const scene::SurfaceSpec& surface)
    : surface_(surface),
      base_(static_cast<float>(surface.ground_height())),
      wall_height_(static_cast<float>(
          surface.pin.min_height +
          kLoweredWall * (surface.border_height.value_or(surface.pin.max_height) - surface.pin.min_height))),
      colour_tables_(make_colour_tables()),
      sky_visibility_(surface.cell_count()),
      prisms_(prisms_per_cell(surface)),
      pins_(prisms_ * surface.cell_count()) {}

float PinShading::height_at(const scene::Snapshot& snapshot, int row, int column) const {
  if (row < 0 || column < 0 || row >= surface_.rows || column >= surface_.columns) return base_;
  // An empty cell has height −∞ and is a hole to the ground.
  return std::max(base_, snapshot.height[surface_.index(row, column)]);
}

PinShading::CornerValues PinShading::sky_visibility(const scene::Snapshot& snapshot, int row,
                                                    int column) const {
  const float own = height_at(snapshot, row, column);
  const float scale = 1.0f / static_cast<float>(surface_.pitch);
  const auto wall = [&](int dr, int dc) {
    return sky_occlusion((height_at(snapshot, row + dr, column + dc) - own) * scale);
  };
  const float west = wall(0, -1), east = wall(0, 1), south = wall(1, 0), north = wall(-1, 0);
  const auto corner = [](float side_a, float side_b, float diagonal) {
    return 1.0f - kCornerOcclusion * (side_a + side_b + std::max(diagonal, std::min(side_a, side_b))) / 3.0f;
  };
  return {corner(south, west, wall(1, -1)), corner(south, east, wall(1, 1)),
          corner(north, west, wall(-1, -1)), corner(north, east, wall(-1, 1))};
}

// Darkens the corners of the pins below a sphere, on a rectangular grid. Positions that are far away or not
// finite are ignored before the conversion to int.
void PinShading::apply_object_occlusion(const scene::Snapshot& snapshot, const std::array<float, 3>& centre,
                                        float radius) {
  if (!surface_.cell_poses.empty()) return;
  const float pitch = static_cast<float>(surface_.pitch), range = kOcclusionRange * radius + pitch;
  const auto cell = [pitch](float length) { return length / pitch; };
  const float south_row = static_cast<float>(surface_.rows - 1);
  const float limit = 2.0f * static_cast<float>(std::max(surface_.rows, surface_.columns));
  if (!(std::abs(cell(centre[0])) < limit) || !(std::abs(cell(centre[1])) < limit)) return;
  const int first_column = std::max(0, static_cast<int>(std::ceil(cell(centre[0] - range))));
  const int last_column =
      std::min(surface_.columns - 1, static_cast<int>(std::floor(cell(centre[0] + range))));
  const int first_row = std::max(0, static_cast<int>(std::ceil(south_row - cell(centre[1] + range))));
  const int last_row =
      std::min(surface_.rows - 1, static_cast<int>(std::floor(south_row - cell(centre[1] - range))));
  const float half_x = static_cast<float>(surface_.pin.top_x) / 2.0f;
  const float half_y = static_cast<float>(surface_.pin.top_y) / 2.0f;
  for (int row = first_row; row <= last_row; ++row)
    for (int column = first_column; column <= last_column; ++column) {
      const int index = surface_.index(row, column);
      const float dz = centre[2] - height_at(snapshot, row, column);
      if (!(dz > 0.0f)) continue;
      for (int corner = 0; corner < 4; ++corner) {
        const float dx = static_cast<float>(column) * pitch + ((corner & 1) ? half_x : -half_x) - centre[0];
        const float dy =
            (south_row - static_cast<float>(row)) * pitch + ((corner & 2) ? half_y : -half_y) - centre[1];
        // Cosine-weighted share of the sky that a sphere covers: (r/d)²·cos θ.
        const float d2 = std::max(dx * dx + dy * dy + dz * dz, radius * radius);
        sky_visibility_[index][corner] *=
            1.0f - kObjectOcclusion * radius * radius * dz / (d2 * std::sqrt(d2));
      }
    }
}

PinShading::ColourTables PinShading::make_colour_tables() {
  ColourTables t;
  const auto bytes = [](const Rgb& screen) {
    const Rgb light = linear_light(screen);
    return Rgba8{to_byte(light[0]), to_byte(light[1]), to_byte(light[2]), 0};
  };
  for (int i = 0; i < 256; ++i) {
    const float share = static_cast<float>(i) / 255.0f;
    Rgb screen;
    // Programs often use only the lower part of the pin's travel; the square root spreads its brightness.
    for (int c = 0; c < 3; ++c)
      screen[c] = kLowestPinColour[c] + (kHighestPinColour[c] - kLowestPinColour[c]) * std::sqrt(share);
    t.height[i] = bytes(screen);
    for (const Palette palette : kPalettes)
      t.channel[static_cast<int>(palette)][i] = bytes(common::palette_color(palette, share));
  }
  t.border = bytes(kBorderColour);
  t.no_value = bytes(kNanColour);
  return t;
}

PinShading::Rgba8 PinShading::pin_colour(const scene::Snapshot& snapshot, const DrawOptions& options, int row,
                                         int column) const {
  const int index = surface_.index(row, column);
  if (surface_.border_height && surface_.is_border(row, column)) return colour_tables_.border;
  if (!options.cell_values.empty()) {
    const float t = (options.cell_values[index] - options.low) / (options.high - options.low);
    return std::isnan(t) ? colour_tables_.no_value
                         : colour_tables_.channel[static_cast<int>(options.palette)][to_byte(t)];
  }
  const float low = static_cast<float>(surface_.pin.min_height);
  const float range = static_cast<float>(surface_.pin.max_height) - low;
  return colour_tables_.height[range > 0.0f ? to_byte((snapshot.height[index] - low) / range) : 255];
}

std::span<const PinInstance> PinShading::update(const scene::Snapshot& snapshot,
                                                const std::vector<scene::ObjectSpec>& catalogue,
                                                const DrawOptions& options, bool north_first, bool east_first,
                                                std::span<const float> recess, const NearWalls& near_walls) {
  for (int row = 0; row < surface_.rows; ++row)
    for (int column = 0; column < surface_.columns; ++column)
      sky_visibility_[surface_.index(row, column)] = sky_visibility(snapshot, row, column);
  if (options.fill_mode == FillMode::kSolid)
    for (std::size_t i = 0; i < snapshot.object_count(); ++i)
      apply_object_occlusion(snapshot, snapshot.position[i],
                             static_cast<float>(catalogue[snapshot.id[i]].half_extents().minCoeff()));
  const auto drawn_height = [&](int row, int column) {
    const bool inside = row >= 0 && column >= 0 && row < surface_.rows && column < surface_.columns;
    const float lower = recess.empty() || !inside ? 0.0f : recess[surface_.index(row, column)];
    const float height = height_at(snapshot, row, column) - lower;
    const bool lowered =
        inside && surface_.border_height &&
        ((near_walls.west && column == 0) || (near_walls.south && row == surface_.rows - 1) ||
         (near_walls.east && column == surface_.columns - 1) || (near_walls.north && row == 0));
    return lowered ? std::min(height, wall_height_) : height;
  };
  std::size_t next = 0;
  for (int r = 0; r < surface_.rows; ++r)
    for (int c = 0; c < surface_.columns; ++c) {
      const int row = north_first ? r : surface_.rows - 1 - r;
      const int column = east_first ? surface_.columns - 1 - c : c;
      if (!std::isfinite(snapshot.height[surface_.index(row, column)])) continue;
      PinInstance& pin = pins_[next++];
      const Eigen::Vector2f centre = surface_.centre(row, column).cast<float>();
      const int cell = surface_.index(row, column);
      const float angle =
          surface_.cell_poses.empty() ? 0.0f : static_cast<float>(surface_.cell_poses[cell].angle);
      pin.position = {centre.x(), centre.y()};
      pin.rotation = {std::cos(angle), std::sin(angle)};
      pin.height = drawn_height(row, column);
      pin.colour = pin_colour(snapshot, options, row, column);
      pin.colour[3] = surface_.is_border(row, column) ? 255 : 0;
      for (int corner = 0; corner < 4; ++corner)
        pin.corner_sky_visibility[corner] = to_byte(sky_visibility_[surface_.index(row, column)][corner]);
      pin.neighbour = {drawn_height(row, column - 1), drawn_height(row, column + 1),
                       drawn_height(row + 1, column), drawn_height(row - 1, column)};
      for (int turn = 1; turn < prisms_; ++turn) {
        pins_[next] = pins_[next - 1];
        const auto [cosine, sine] = pins_[next - 1].rotation;
        pins_[next++].rotation = {kCosine60 * cosine - kSine60 * sine, kSine60 * cosine + kCosine60 * sine};
      }
    }
  return std::span<const PinInstance>(pins_).first(next);
}

float PinShading::mean_height_around(const scene::Snapshot& snapshot, float x, float y, float radius) const {
  static constexpr float kDiagonal = 0.70710678f;
  static constexpr float kRing[8][2] = {{1, 0},  {kDiagonal, kDiagonal},   {0, 1},  {-kDiagonal, kDiagonal},
                                        {-1, 0}, {-kDiagonal, -kDiagonal}, {0, -1}, {kDiagonal, -kDiagonal}};
  const float pitch = static_cast<float>(surface_.pitch);
  const float limit = 2.0f * static_cast<float>(std::max(surface_.rows, surface_.columns));
  if (!(std::abs(x / pitch) < limit) || !(std::abs(y / pitch) < limit)) return base_;
  float sum = 0.0f;
  for (const auto& direction : kRing) {
    const int column = static_cast<int>(std::floor((x + direction[0] * radius) / pitch + 0.5f));
    const int row =
        surface_.rows - 1 - static_cast<int>(std::floor((y + direction[1] * radius) / pitch + 0.5f));
    sum += height_at(snapshot, row, column);
  }
  return sum / 8.0f;
}

}  // namespace smartsurf::view
