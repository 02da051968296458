#include "core/sha256.h"

#include <array>
#include <iterator>
#include <memory>

#include <fmt/format.h>
#include <openssl/evp.h>

#include "core/check.h"

namespace relocd {

std::string Sha256Hex(std::string_view bytes, const Progress& progress) {
  constexpr std::size_t kStep = std::size_t{1} << 20;
  const std::unique_ptr<EVP_MD_CTX, decltype(&::EVP_MD_CTX_free)> context(::EVP_MD_CTX_new(),
                                                                          &::EVP_MD_CTX_free);
  int ok = ::EVP_DigestInit_ex(context.get(), ::EVP_sha256(), nullptr);
  while (ok == 1 && !bytes.empty()) {
    const std::string_view step = bytes.substr(0, kStep);
    ok = ::EVP_DigestUpdate(context.get(), step.data(), step.size());
    bytes.remove_prefix(step.size());
    progress();
  }
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  if (ok == 1) ok = ::EVP_DigestFinal_ex(context.get(), digest.data(), &size);
  RELOCD_CHECK(ok == 1, "OpenSSL has SHA-256");
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) {
    fmt::format_to(std::back_inserter(hex), "{:02x}", digest.at(i));
  }
  return hex;
}

}  // namespace relocd
