# The command subap on an empty base: docker run --rm -v "$PWD:/data" -w /data subaperture focus recording.cphd
FROM rust:1.95-slim AS build
RUN rustup target add x86_64-unknown-linux-musl aarch64-unknown-linux-musl
WORKDIR /source
COPY . .
RUN cargo xtask dist && \
    tar -xzf target/dist/subaperture-*-"$(uname -m)"-unknown-linux-musl.tar.gz --strip-components=1 --one-top-level=/subaperture && \
    mkdir -m 1777 /subaperture/tmp

FROM scratch
COPY --from=build /subaperture /
ENTRYPOINT ["/subap"]
