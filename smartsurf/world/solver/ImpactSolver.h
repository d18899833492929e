// Impacts: contacts that close faster than the restitution threshold.
//
// An impact takes no time, so it is kept out of the substeps: an impacting contact exerts no impulse there.
// At the end of the step the bodies are set back to where they touch, except two that meet in flight, which
// move on from where they meet. The impacts are solved in generations, as reflections (B. Smith et al.,
// Reflections on Simultaneous Impact, 2012): all contacts that approach collide at once, by Newton's law and
// with Coulomb friction on the same impulse; then those that approach because of it, and so on. So a blow
// travels through a row of balls one by one, and what is symmetric stays symmetric.
//
// One thread solves the impacts. Where a blow reaches many contacts, the team shares the search for those
// that approach or resist and the sweeps: island by island, and a great island slab by slab. An island is
// swept for as long as the whole list would be. The order of a sweep depends on the contacts alone.
#pragma once

#include <algorithm>
#include <compare>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/body/VectorRow.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/CellForceLimits.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/JointSolver.h"

namespace smartsurf::world {

class ImpactSolver {
 public:
  // True if nothing but `partner` comes within `reach` of the body's bounding sphere in the step.
  using HasRoom = std::function<bool(std::int32_t body, std::int32_t partner, float reach)>;

  // A contact that approaches at the start of the step.
  struct Candidate {
    bool is_pair;
    bool in_substeps;  // exerted its part of the impulse there, without restitution
    std::int32_t manifold, contact;
    float approach_speed;  // normal velocity at the start of the step; negative
  };

  struct Step {
    const BodyStore& bodies;  // as of the start of the step
    const SpatialPartition& partition;
    ContactList &pair_contacts, &static_contacts;
    std::span<const CellImpulseLimit> cell_limits;  // one per static contact; empty without force limits
    SurfaceMaterial field_material;
    float dt_s;
    int substeps;
    const HasRoom& has_room;
    JointSolver& joints;
    // ---- by row; in and out
    BodyVelocity* velocity;
    DeltaPose* delta_pose;

    const ContactList& list(bool is_pair) const { return is_pair ? pair_contacts : static_contacts; }

    // The greatest separation at which a contact takes part in a blow of this normal speed, where another
    // contact of the manifold touches: that which closes within the substep. Otherwise bodies would turn
    // about those that touch.
    float touching_separation(float speed) const {
      return std::max(kTouchingSeparation, -speed * dt_s / static_cast<float>(substeps));
    }
  };

  // Removes all candidates. Call before the members add theirs.
  void reset(int member_count);
  void add(int member, const Candidate& candidate) { members_[member].candidates.push_back(candidate); }
  // Solves the impacts among the candidates and all that follow from them, after the substeps. Adds their
  // impulses to Contact::total_normal_impulse. Called by all members, which meet before and after.
  void solve(const Step&, const Member&);

 private:
  struct ManifoldRef {
    bool is_pair;
    std::int32_t index;
  };
  // A candidate that touches within the step.
  struct Hit : Candidate {
    explicit Hit(const Candidate& candidate) : Candidate(candidate) {}

    float fraction = 1.0F;           // of the step, at which the bodies meet; not of one in substeps
    Vec3 normal, approach{0, 0, 0};  // of a pair, as they meet: the movement of a relative to b until then
    Vec3 set_back_a{0, 0, 0}, set_back_b{0, 0, 0};  // of a pair
  };
  // A static contact that a sphere was to hit after another one: its separation when the sphere hits the
  // first, and how long the step lasts from there on.
  struct Postponed {
    float separation = 0.0F, time_left_s = 0.0F;
    bool is_met_at(float speed) const { return separation + time_left_s * speed <= 0.0F; }
  };
  // The two sides of a contact in the state at the end of the substeps.
  struct Sides {
    BodyVelocity *velocity_a, *velocity_b = nullptr;  // b: null if static
    DeltaPose *delta_a, *delta_b = nullptr;
    Vec3 anchor_a, anchor_b{0, 0, 0}, surface_velocity;

    Sides(const Step&, const Manifold&, const Contact&);
    // Velocity of a relative to b, or to the static surface.
    Vec3 velocity() const {
      const Vec3 v = of_point(*velocity_a, anchor_a);
      return v - (velocity_b == nullptr ? surface_velocity : of_point(*velocity_b, anchor_b));
    }
    Vec3 displacement_a() const;
    Vec3 displacement_b(float dt_s) const;
    float separation(const Contact&, float dt_s) const;

   private:
    static Vec3 displacement(const DeltaPose&, const Vec3& anchor);
    static Vec3 of_point(const BodyVelocity& v, const Vec3& anchor) {
      using ConstVec = Eigen::Map<const Vec3>;
      return ConstVec(v.velocity) + ConstVec(v.angular_velocity).cross(anchor);
    }
  };
  struct RowState {
    std::uint32_t version = 0;  // counts the changes of the body's velocity
    bool is_changed = false;    // the body is among changed_bodies_, or will be
  };
  // What the impulses of a point change of a body that moves, by a unit impulse along each of its axes.
  struct Response {
    BodyVelocity* velocity;
    RowState* state;
    std::int32_t body, row;
    Float4 linear[3], spin[3];
  };
  // A colliding contact of the current generation. Components are along the normal and two tangents. In the
  // list, several members write to neighbours. What a sweep reads of a point that it leaves alone comes
  // first.
  struct alignas(64) Point {
    Point(BodyVelocity* of_a, BodyVelocity* of_b) : velocity_a(of_a), velocity_b(of_b) {}
    explicit Point(const Sides& sides) : Point(sides.velocity_a, sides.velocity_b) {
      anchor_a = to_row(sides.anchor_a), anchor_b = to_row(sides.anchor_b);
      surface_velocity = to_row(sides.surface_velocity);
    }

    RowState *state_a, *state_b;
    std::uint32_t seen_normal, seen_friction;  // versions() after each was solved last
    BodyVelocity *velocity_a, *velocity_b;
    float normal_mass, target_speed, max_impulse, friction;
    Float4 anchor_a, anchor_b, surface_velocity;
    Float4 axis[3];
    Float4 spin_a[3], spin_b[3];  // change of angular velocity by a unit impulse along an axis
    Vec3 impulse;
    float blow_speed;       // greatest change of speed by the blow: the scale of errors
    float tangent_mass[3];  // inverse of the inverse effective mass matrix in the tangent plane: tt, uu, tu
    float slip_mass;        // inverse of that matrix's greater eigenvalue
    // In responses_: of the bodies of both sides and those that joints connect with them. None without
    // joints.
    std::int32_t first_response = 0, response_count = 0;
    std::int32_t a, b;          // bodies; b = −1: static
    std::int32_t row_a, row_b;  // of a and b
    // ≥ 0: the point is no contact but a joint at a limit, in stops_. It has no friction; the anchors are the
    // stop's turns, and the normal is its linear part.
    std::int32_t stop = -1;
    Contact* contact;
    Vec3 velocity_before;
    float energy_budget;  // what the contact lost in the substeps

    // Velocity of a relative to b, or to the static surface.
    Float4 velocity() const {
      const Float4 v = of_point(*velocity_a, anchor_a);
      return v - (velocity_b == nullptr ? surface_velocity : of_point(*velocity_b, anchor_b));
    }
    float normal_speed() const {
      if (stop < 0) [[likely]]
        return dot(axis[0], velocity());
      return of_stop(*velocity_a, anchor_a) - (velocity_b == nullptr ? 0.0F : of_stop(*velocity_b, anchor_b));
    }
    Vec3 velocity_along_axes() const {
      if (stop >= 0) return {normal_speed(), 0.0F, 0.0F};
      const Float4 v = velocity();
      return {dot(axis[0], v), dot(axis[1], v), dot(axis[2], v)};
    }

   private:
    static Float4 of_point(const BodyVelocity& v, const Float4& anchor) {
      return load4(v.velocity) + cross(load4(v.angular_velocity), anchor);
    }
    float of_stop(const BodyVelocity& v, const Float4& turn) const {
      return dot(axis[0], load4(v.velocity)) + dot(turn, load4(v.angular_velocity));
    }
  };
  struct Approaching {
    Contact* contact;
    float rebound_speed;
  };
  struct IslandEnergy {
    float linear = 0, quadratic = 0, budget = 0;
  };
  // A sweep over a great island goes through the points within each slab, then through those between each
  // slab and the next, first the even ones, and at last through the others: of large bodies, of sleepers, of
  // bodies that move far. Within a phase no body has points in two slabs, so members may take a slab each.
  enum Phase { kWithinSlabs, kAfterEvenSlabs, kAfterOddSlabs, kElsewhere, kPhases };
  // Points that reach each other through bodies, fixed ones too.
  struct Island {
    std::int32_t root;
    std::int32_t first = 0, count = 0;  // in order_
    std::int32_t friction_sweeps = 0;
    // In bounds_, of a great island: for each phase, where the points of each member begin, and the end.
    std::int32_t first_bound = -1;
    bool is_settled = false;  // further sweeps change nothing
  };
  // Islands that a member claims at once.
  struct Chunk {
    std::size_t first, end;  // in islands_
    char is_claimed = 0;
  };
  // A body whose velocity has changed; `order`: by sweep, and by point in the order of the sweep.
  struct Change {
    std::uint64_t order;
    std::int32_t body;
    auto operator<=>(const Change&) const = default;
  };
  struct alignas(128) MemberState {
    std::vector<Candidate> candidates;
    std::vector<Change> changes;
    std::vector<Contact*> contacts;        // of a manifold that may resist
    std::vector<Approaching> approaching;  // of a manifold
    bool rebounds = false;                 // a contact that it found to approach
    float greatest_change[2];              // of the last two sweeps of the team
  };
  // Who sweeps over an island: a member, or the team, of which this is a member.
  struct Sweeper {
    MemberState& state;
    const Member* team = nullptr;
    bool is_odd = false;  // number of sweeps until now
  };
  // A point's visit in a sweep.
  struct Visit {
    std::vector<Change>& changes;
    int sweep;
    std::size_t place;
    // The place of a change to one of the point's two bodies among those of a serial sweep; `side`: 0 or 1.
    std::uint64_t order(std::uint64_t side) const {
      return static_cast<std::uint64_t>(sweep) << 32U | place << 1U | side;
    }
  };
  // What the caller has all members do.
  enum class Task { kNone, kFindApproaching, kFindResisting, kSolveNormals, kSolvePoints };

  void solve_on_caller(const Step&, const Member&);
  void run(Task, const Step&, const Member&, bool shares);
  void work_on_task(const Step&, const Member&);
  void run_sweeps(Task, const Step&, const Member&, int max_sweeps);
  void find_islands(const SpatialPartition&);
  void order_by_slab(Island&, const SpatialPartition&);
  void group_islands(int member_count);
  void sweep_islands(const Member&);
  void sweep_island(Island&, Sweeper);
  bool continue_islands();
  void take_changes();
  void find_hits(const Step&);
  void postpone_later_hits(const Step&);
  bool postpone(const Step&, const Hit&, float earliest);
  bool meet(const Step&, Hit&) const;
  void index_manifolds(const Step&);
  void set_back_bodies(const Step&);
  void set_back(const Step&, const Manifold&, const Contact&, float min_overlap, Hit* hit = nullptr);
  void move_on(const Step&);
  void move_pair_on(const Step&, std::size_t first, std::size_t end);
  void mark_changed(const Step&, std::int32_t body);
  void forget_changed_bodies(const Step&);
  void collect_active_manifolds(const Step&);
  void add_hits(const Step&);
  Point make_meeting(const Step&, const Hit&, const Manifold&, Contact&);
  bool add_found_points(Task, const Step&, const Member&);
  void take_changed_bodies(const Step&);
  template <class Each>
  void for_each_struck_manifold(const Step&, Each each);
  void find_approaching(const Step&, const ManifoldRef&, MemberState&, std::vector<Point>& found);
  void find_resisting(const Step&, const ManifoldRef&, MemberState&, std::vector<Point>& found);
  static void set_target(Point&, float speed, float blow_speed);
  char& is_point(const Step&, bool is_pair, const Contact&);
  void clear_points(const Step&);
  Point make_point(const Step&, const Manifold&, Contact&);
  Point make_point(const Step&, const Manifold&, Contact&, const Sides&, const Vec3& normal);
  void add_point(const Step&, const Point&);
  void add_responses(const Step&, Point&);
  static JointSolver::RowChange response_alone(const Point&, int side, int axis);
  static void set_masses(Point&, float nn, float tt, float uu, float tu);
  std::span<const Response> responses_of(const Point& p) const {
    return std::span(responses_).subspan(p.first_response, p.response_count);
  }
  // Calls each(body, row) for all bodies that an impulse of the point moves, and for immovable ones of its
  // own.
  template <class Each>
  void for_each_body(const Point& p, Each each) const {
    each(p.a, p.row_a);
    if (p.b >= 0) each(p.b, p.row_b);
    for (const Response& r : responses_of(p)) each(r.body, r.row);
  }
  void add_stops(const Step&);
  Point make_stop(const Step&, const JointSolver::Stop&);
  void add_response_of_stop(const Step&, Point&);
  void take_row_changes(const Step&, Point&, int axis);
  void add_blows_to_joints(const Step&);
  void solve_points(Island&, Sweeper&);
  bool solve_normals(const Island&, Sweeper&, int max_sweeps, int first_number);
  bool normals_are_solved(const Island&, Sweeper&);
  template <class Each>
  float sweep(const Island&, Sweeper&, bool is_backward, int number, Each each);
  // A number that changes whenever the velocity of one of the two bodies does.
  static std::uint32_t versions(const Point& p) {
    return p.state_a->version + (p.state_b == nullptr ? 0 : p.state_b->version);
  }
  // Those of two slabs are on different cache lines: members that sweep over neighbouring slabs would delay
  // each other.
  std::int32_t index_of_state(std::int32_t row) const {
    constexpr int kRowsBetweenSlabs = 128 / sizeof(RowState);
    return row + slab_of_row_[row] * kRowsBetweenSlabs;
  }
  RowState& state_of_row(std::int32_t row) { return row_states_[index_of_state(row)]; }
  void apply_impulse(Point&, int axis, float impulse);
  void move_mechanisms(const Point&, int axis, float impulse);
  float count_change(const Point&, float impulse_change, const Visit&);
  static void prefetch(const Point&);
  float solve_normal(Point&, const Visit&);
  float solve_friction(Point&, const Visit&);
  void limit_energy();

  std::vector<MemberState> members_;
  std::vector<Hit> hits_;
  // Manifolds of each body. Pairs are linked lists of 2·i (as body a) and 2·i + 1 (as body b) for manifold i.
  std::vector<std::int32_t> first_pair_, next_pair_, static_manifold_;
  std::vector<Postponed> postponed_;       // by static contact; empty if there is none
  std::vector<std::uint8_t> static_hits_;  // by body: generations that its static contacts took part in
  std::vector<RowState> row_states_;
  // Bodies that the last generation moved, and their manifolds.
  std::vector<std::int32_t> changed_bodies_;
  std::vector<std::int32_t> struck_;  // those whose manifolds the members look at
  std::vector<std::int32_t> place_;   // by body: where it is in struck_; of others anything
  // By chunk of struck_, which members claim one after the other: the points that were found.
  std::vector<std::vector<Point>> found_;
  int next_chunk_ = 0, chunk_count_ = 0;
  std::vector<ManifoldRef> active_;
  std::vector<char> is_active_pair_;
  float tolerance_ = 0.0F;                  // of the current generation
  bool is_last_ = false;                    // of the generations: without restitution
  bool rebounds_ = false;                   // a contact of the last generation
  std::vector<float> blow_speed_;           // by body
  std::vector<std::int32_t> moved_bodies_;  // in the current generation
  std::vector<Point> points_;
  std::vector<Response> responses_;                  // of points of bodies with joints
  std::vector<JointSolver::RowChange> row_changes_;  // of one of these
  std::vector<JointSolver::Stop> stops_, found_stops_;
  std::vector<std::int32_t> struck_trees_;
  std::vector<char> is_point_[2];  // by contact: static ones, those of pairs
  // Indexed by body; valid for the bodies of points_.
  std::vector<std::int32_t> island_;
  std::vector<IslandEnergy> energy_;
  // ---- sweeps
  Task task_ = Task::kNone;
  int max_sweeps_ = 0;
  std::vector<std::int32_t> root_;  // by row: another of its island, or itself; −1: no point touches it
  std::size_t joined_points_ = 0;   // how many of the list root_ knows
  std::vector<std::int32_t> island_of_root_;
  std::vector<Island> islands_;
  std::vector<std::int32_t> order_;  // points, island by island, in the order of their sweeps
  std::vector<std::int32_t> bounds_, slab_of_row_, first_in_slab_, unordered_;
  std::vector<std::int32_t> key_of_point_;  // its island, or its place in the order of phases and slabs
  std::size_t shared_islands_ = 0;          // the first of islands_, which the team sweeps together
  std::vector<Chunk> chunks_;
  std::size_t lone_islands_ = 0;            // each the only one of a chunk; these come first
  std::int32_t least_friction_sweeps_ = 0;  // that each island takes part in
  std::vector<Change> changes_;
};

}  // namespace smartsurf::world
