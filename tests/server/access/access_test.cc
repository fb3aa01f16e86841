#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <string>

#include "config/common/token_hash.h"
#include "server/access/admission_control.h"

namespace terrace::server {
namespace {

constexpr const char* kToken = "0123456789abcdef";
// As `printf 0123456789abcdef | sha256sum` prints it.
const std::string kHash = "9f9f5111f7b27a781f1f1ddde5ebc2dd2b796bfc7365c9c28b548e564176929f";

config::TokenConfig Hashed(std::string sha256, std::string name = "field team") {
  config::TokenConfig options;
  options.name = std::move(name);
  options.sha256 = std::move(sha256);
  options.datasets = {"maui"};
  return options;
}

TEST(AccessPolicy, ATokenMayBeGivenAsItsHash) {
  std::string upper = kHash;
  std::transform(upper.begin(), upper.end(), upper.begin(), [](unsigned char c) { return std::toupper(c); });
  for (const std::string& hash : {kHash, upper}) {
    const auto policy = AccessPolicy::Make({Hashed(hash)}, {"earth"});
    ASSERT_TRUE(policy) << policy.error().message;
    const GrantPtr grant = policy->Find(kToken);
    ASSERT_NE(grant, nullptr);
    EXPECT_EQ(grant->name, "field team");
    EXPECT_TRUE(grant->Sees("maui") && grant->Sees("earth"));
    EXPECT_FALSE(grant->Sees("secret"));
    EXPECT_EQ(policy->Find(kHash), nullptr) << "the hash itself is no token";
    EXPECT_EQ(policy->Find(""), nullptr);
    EXPECT_FALSE(policy->anonymous()->Sees("maui"));
  }
}

TEST(AccessPolicy, RefusesWhatIsNoHash) {
  for (const std::string& hash : {kHash.substr(1), kHash + "0", "g" + kHash.substr(1), kHash.substr(1) + " "}) {
    const auto policy = AccessPolicy::Make({Hashed(hash)}, {});
    ASSERT_FALSE(policy) << hash;
    EXPECT_NE(policy.error().message.find("64 hexadecimal digits"), std::string::npos) << policy.error().message;
  }
}

TEST(AccessPolicy, RefusesTheSameTokenTwice) {
  const auto policy = AccessPolicy::Make({Hashed(config::TokenHash(kToken), "plain"), Hashed(kHash)}, {});
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().message.find("another token is the same"), std::string::npos) << policy.error().message;
}

TEST(AccessPolicy, WithoutTokensEverybodySeesEverything) {
  const auto policy = AccessPolicy::Make({}, {});
  ASSERT_TRUE(policy);
  EXPECT_FALSE(policy->has_tokens());
  EXPECT_TRUE(policy->anonymous()->Sees("anything"));
}

}  // namespace
}  // namespace terrace::server
