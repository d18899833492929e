#include "smartsurf/world/contact/Contact.h"

#include <gtest/gtest.h>

using namespace smartsurf::world;

namespace {

Contact contact_with(Partner partner) {
  Contact c;
  c.partner = partner;
  return c;
}

TEST(Contact, PredicatesHoldForThePartnersThatTheyDescribe) {
  struct Case {
    Partner partner;
    bool cell, skin, gives_way, moves_with_cell, loads_cell;
  };
  for (const Case& expected : {Case{Partner{0}, false, false, false, false, false},
                               {Partner::kCell, true, false, false, true, true},
                               {Partner::kGround, false, false, false, false, false},
                               {Partner::kRemovedBody, false, false, false, false, false},
                               {Partner::kSupportedCell, true, false, false, true, false},
                               {Partner::kYieldingTip, false, false, true, false, true},
                               {Partner::kSkin, false, true, false, true, true},
                               {Partner::kElasticSkin, false, true, true, false, true}}) {
    SCOPED_TRACE(static_cast<int>(expected.partner));
    const Contact c = contact_with(expected.partner);
    EXPECT_EQ(c.touches_cell(), expected.cell);
    EXPECT_EQ(c.touches_skin(), expected.skin);
    EXPECT_EQ(c.gives_way(), expected.gives_way);
    EXPECT_EQ(c.moves_with_cell(), expected.moves_with_cell);
    EXPECT_EQ(c.loads_cell(), expected.loads_cell);
  }
}

TEST(Contact, RemovedBodyShiftsIndicesAndKeepsTheOtherPartners) {
  ContactList list;
  for (const Partner partner : {Partner{1}, Partner{2}, Partner{3}, Partner::kCell, Partner::kElasticSkin})
    list.contacts.push_back(contact_with(partner));
  list.manifolds = {{0, Manifold::kStatic, 0, 4}, {3, Manifold::kStatic, 4, 1}, {0, 2, 0, 1}};
  remove_body(list, 2);
  std::vector<Partner> partners;
  for (const Contact& c : list.contacts) partners.push_back(c.partner);
  EXPECT_EQ(partners, (std::vector{Partner{1}, Partner::kRemovedBody, Partner{2}, Partner::kCell,
                                   Partner::kElasticSkin}));
  ASSERT_EQ(list.manifolds.size(), 2U);
  EXPECT_EQ(list.manifolds[1].a, 2);
  EXPECT_EQ(other_body(list.manifolds[0], list.contacts[0]), 1);
  EXPECT_LT(other_body(list.manifolds[0], list.contacts[1]), 0);
  EXPECT_EQ(other_body({0, 5, 0, 1}, list.contacts[0]), 5);
}

}  // namespace
