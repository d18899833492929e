// The contact loads of bodies that have fallen asleep: in static equilibrium.
//
// An object on uneven pins may jitter without going anywhere, so the impulses of the step in which it falls
// asleep are those of one moment. They are moved to the nearest ones that balance the weight of each body, by
// least squares relative to the impulses themselves; what the laws of levers determine does not depend on
// that choice. Loads are not negative. Bodies and the impulses that warm-start them stay as they are.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "smartsurf/world/SleepingContacts.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/solver/BlockCholesky.h"

namespace smartsurf::world {

class RestLoads {
 public:
  struct Settings {
    Vec3 gravity{0, 0, 0};
    float dt_s = 0.0F;
    int substeps = 1;
    SurfaceMaterial field_material{};
  };
  explicit RestLoads(const Settings& settings) : settings_(settings) {}

  // Balances the loads in `contacts` of the islands of these bodies, which are asleep, each once.
  // `pair_contacts`: of the step, with those of sleepers that bear bodies which are awake. Islands with
  // joints, large ones, and those that no plausible loads balance keep their loads; those of some size that
  // touch what is awake keep them until that sleeps.
  void balance(const BodyStore&, std::span<const std::int32_t> fallen, const ContactList& pair_contacts,
               SleepingContacts& contacts);
  // Passes over islands, in bodies, that all calls took.
  std::size_t work() const { return work_; }

 private:
  using Vector6 = std::array<double, 6>;  // linear, angular; lengths relative to the body's radius
  // A component of an impulse: along a contact's normal or a tangent, or a rolling torque.
  struct Row {
    std::int32_t a = 0, b = -1;    // in the island; b = −1: what does not move
    Vector6 on_a = {}, on_b = {};  // by a unit impulse
    double start = 0.0, impulse = 0.0, weight = 0.0;
    float* load = nullptr;     // of a normal: where its impulse is kept
    std::int32_t normal = -1;  // of a tangent or a torque: its normal's row; −1: none
    float limit = std::numeric_limits<float>::infinity();
    bool touches = true, is_free = true;
    bool is_used = true;  // its impulse is free, and that of its normal
  };

  // A manifold of a sleeper and a body that is awake.
  struct Touch {
    std::int32_t sleeper, manifold;
    auto operator<=>(const Touch&) const = default;
  };

  void find_touches(const BodyStore&, const ContactList& pair_contacts);
  std::span<const Touch> touches_of(std::int32_t body) const;
  bool is_incomplete() const;
  bool collect_island(const BodyStore&, std::int32_t from, const SleepingContacts&);
  void add_rows(const BodyStore&, SleepingContacts&);
  void add_contact(const BodyStore&, const Manifold&, Contact&);
  void add_patch(SupportPatch&, SupportSamples&, const Vec3& normal, float limit);
  Row& add_row(std::int32_t a, std::int32_t b);
  void add_weight_and_neighbours(const BodyStore&, const ContactList& pair_contacts);
  bool is_balanced(double tolerance) const;
  bool solve();
  bool find_impulses();
  void subtract(const Row&, double impulse);
  void add_free_rows();
  void set_free(bool with_touching);

  Settings settings_;
  std::size_t work_ = 0;
  std::vector<Touch> touches_;               // ascending
  std::vector<std::int32_t> island_;         // bodies
  std::vector<std::int32_t> index_of_body_;  // in island_; −1: in none
  std::vector<double> radius_, inverse_radius_, own_weight_;
  std::vector<Row> rows_;
  std::vector<Vector6> load_, residual_, change_;
  LargeBlockCholesky matrix_;
  std::vector<double> trace_;  // of its blocks on the diagonal
  double mean_load_ = 0.0;
};

}  // namespace smartsurf::world
