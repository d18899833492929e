#include "smartsurf/world/broadphase/SpatialPartition.h"

#include <algorithm>

namespace smartsurf::world {
namespace {

constexpr int kMinBodiesPerSlab = 128, kMaxSlabs = 64;  // approximate

}  // namespace

void SpatialPartition::build(const UniformGrid& grid, int bodies) {
  if (std::ssize(row_of_body_) != bodies) row_of_body_.assign(bodies, 0);
  if (!first_row_.empty()) first_row_.back() -= added_rows_;
  added_rows_ = 0;
  // A single slab of the grid's bodies depends on their number only.
  const auto large_count = static_cast<int>(grid.large_bodies().size());
  if (grid.sorted_count() < 2 * kMinBodiesPerSlab && slab_count() == 2 &&
      rows_of(0).end == grid.sorted_count() && row_count() == grid.sorted_count() + large_count)
    return;
  find_first_rows(grid);
  weight_prefix_.assign(first_row_.begin(), first_row_.end());
  active_end_.resize(slab_count());
  body_of_row_.resize(row_count());
}

// A slab takes whole slices until it has enough bodies.
void SpatialPartition::find_first_rows(const UniformGrid& grid) {
  const int bodies = grid.sorted_count();
  first_row_.assign(1, 0);
  if (bodies >= 2 * kMinBodiesPerSlab) {
    const int target_bodies = std::max(kMinBodiesPerSlab, bodies / kMaxSlabs);
    const auto rows = grid.rows();
    for (std::size_t r = 1; r + 1 < rows.size(); ++r)
      if (rows[r].slice > rows[r - 1].slice && rows[r].begin - first_row_.back() >= target_bodies)
        first_row_.push_back(rows[r].begin);
  }
  first_row_.push_back(bodies);
  first_row_.push_back(bodies + static_cast<std::int32_t>(grid.large_bodies().size()));
}

void SpatialPartition::set_contact_counts(std::span<const std::size_t> contacts) {
  constexpr long kBodyCost = 3, kContactCost = 2;  // relative cost, measured roughly
  for (std::size_t s = 0; s < contacts.size(); ++s)
    weight_prefix_[s + 1] = weight_prefix_[s] + kBodyCost * (first_row_[s + 1] - first_row_[s]) +
                            kContactCost * static_cast<long>(contacts[s]);
}

// Cuts at the slab boundaries nearest to even shares of the weight.
IndexRange SpatialPartition::share(const Member& member) const {
  auto slab_at = [&](int index) {
    const long wanted = weight_prefix_.back() * index / member.member_count;
    const auto after = std::lower_bound(weight_prefix_.begin(), weight_prefix_.end(), wanted);
    const bool nearer_before = after != weight_prefix_.begin() && wanted - *(after - 1) < *after - wanted;
    return static_cast<int>(after - weight_prefix_.begin()) - (nearer_before ? 1 : 0);
  };
  return {member.index == 0 ? 0 : slab_at(member.index),
          member.index + 1 == member.member_count ? slab_count() : slab_at(member.index + 1)};
}

void SpatialPartition::add_row(std::int32_t body) {
  const std::int32_t first_added = row_count() - added_rows_, known = row_of_body_[body];
  if (known >= first_added && known < row_count() && body_of_row_[known] == body) return;
  row_of_body_[body] = row_count();
  body_of_row_.resize(row_count());
  body_of_row_.push_back(body);
  ++first_row_.back();
  ++added_rows_;
}

void SpatialPartition::assign_rows(const BodyStore& bodies, const UniformGrid& grid, const Member& member) {
  const IndexRange own_slabs = share(member);
  for (int s = own_slabs.begin; s < own_slabs.end; ++s) {
    const IndexRange rows = rows_of(s);
    int active_end = rows.begin, inactive_begin = rows.end;
    auto assign = [&](std::int32_t body) {
      const int row = bodies.is_active(body) ? active_end++ : --inactive_begin;
      body_of_row_[row] = body;
      row_of_body_[body] = row;
    };
    if (s + 1 == slab_count())
      for (const std::int32_t body : grid.large_bodies()) assign(body);
    else
      for (int k = rows.begin; k < rows.end; ++k) assign(grid.body(k));
    active_end_[s] = active_end;
  }
}

}  // namespace smartsurf::world
