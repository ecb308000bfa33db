# axiswatch in a container.
#   tools/build-image.sh
#   docker run --network host -v /etc/axiswatch:/etc/axiswatch:ro -v axiswatch:/var/lib/axiswatch axiswatch
# --network host: SocketCAN interfaces belong to the host's network namespace.
#
# In the configuration: state_dir = "/var/lib/axiswatch" in [service].
# 127.0.0.1, the default of [web], is that of the host, and only the host reaches the page. For other machines:
# host = "0.0.0.0", hosts, certificate and key in [web] of the mounted configuration (the user axiswatch must be able to
# read the key), and a token:
#   docker run --rm -v /etc/axiswatch:/etc/axiswatch:ro -v axiswatch:/var/lib/axiswatch axiswatch \
#     axiswatch token new NAME --scope read --config /etc/axiswatch/axiswatch.toml
# A published port (-p) reaches the container only by host = "0.0.0.0", too.

# Any image with python3 (3.11 or newer), venv and pip.
ARG BASE_IMAGE=docker.io/library/python:3.11-slim

FROM ${BASE_IMAGE} AS build
WORKDIR /src
RUN command -v strip || { apt-get update && apt-get install --yes --no-install-recommends binutils; }
RUN python3 -m venv /opt/axiswatch
COPY requirements-runtime.lock ./
# A mirror of PyPI: tools/build-image.sh --secret id=pip.conf,src=FILE, which leaves no trace in the image.
RUN --mount=type=secret,id=pip.conf,target=/etc/pip.conf \
    /opt/axiswatch/bin/pip install --no-cache-dir --no-compile --require-hashes -r requirements-runtime.lock
COPY pyproject.toml README.md hatch_build.py ./
COPY docs/openapi.json docs/
COPY monitor_core monitor_core
COPY service service
COPY config config
# numba knows a compiled kernel by its source's modification time, and image layers keep whole seconds only:
# round first, then compile.  Without the libraries' own tests, symbols and C sources, the installer, and pyarrow's ways
# to other machines the image is 220 MB smaller.  Symbols: of three only, as a library that was repaired for its wheel
# (OpenBLAS, numba's pools) cannot be loaded any more once it is stripped.  The dashboard is that of service/web/static
# where it is built, else npm must be reached.
RUN --mount=type=secret,id=pip.conf,target=/etc/pip.conf \
    /opt/axiswatch/bin/pip install --no-cache-dir --no-compile --no-deps . \
 && /opt/axiswatch/bin/pip uninstall --yes setuptools pip \
 && find /opt/axiswatch -type d -name tests -prune -exec rm -r {} + \
 && find /opt/axiswatch -regex '.*\.\(pyi\|pxd\|pyx\|c\|h\|hpp\|cpp\|a\)' -delete \
 && cd /opt/axiswatch/lib/python3*/site-packages && rm -rf pyarrow/include pyarrow/*_flight* pyarrow/*_s3* \
 && find llvmlite pyarrow scipy -name '*.so*' -type f -exec strip --strip-unneeded {} + && cd /src \
 && find /opt/axiswatch -name '*.py' -exec touch -d "@$(date +%s)" {} + \
 && /opt/axiswatch/bin/python -m compileall -q -j 0 /opt/axiswatch/lib

FROM ${BASE_IMAGE}
COPY --from=build /opt/axiswatch /opt/axiswatch
RUN useradd --system --no-create-home --home-dir /var/lib/axiswatch --shell /usr/sbin/nologin axiswatch \
 && install -d -o axiswatch -g axiswatch /var/lib/axiswatch /var/cache/axiswatch && install -d /etc/axiswatch
ENV PATH=/opt/axiswatch/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    NUMBA_CACHE_DIR=/var/cache/axiswatch \
    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1
USER axiswatch
WORKDIR /var/lib/axiswatch
# Daemon, identify and excite, compiled for the processor that builds the image; on another kind the first start of
# each compiles again.  Not in the volume: that of an older image would hide it.
RUN axiswatch warm
VOLUME /var/lib/axiswatch
EXPOSE 8080
# Without TLS, or with it; the certificate is that of another name than 127.0.0.1, and this is the same machine.
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
  CMD for scheme in http https; do python -c "import ssl, sys, urllib.request as r; \
      r.urlopen(sys.argv[1], timeout=2, context=ssl._create_unverified_context())" $scheme://127.0.0.1:8080/healthz \
      2>/dev/null && exit 0; done; exit 1
CMD ["axiswatch", "run", "--config", "/etc/axiswatch/axiswatch.toml"]
