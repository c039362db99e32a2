# `zeroscd serve` in a container; docs/serve.md says how to build and run it, and
# tests/serve/test_dockerfile.py checks that both agree.
FROM python:3.12.12-slim-bookworm

# For example "--index-url ADDRESS" of a mirror, or of torch's builds without CUDA (4 GB less).
ARG PIP_OPTIONS=""

# Nobody else's: no shell, no password, owner of nothing but /state.
RUN useradd --system --uid 10001 --shell /usr/sbin/nologin zeroscd \
    && install --directory --owner zeroscd --mode 0700 /state

WORKDIR /src
COPY pyproject.toml README.md LICENSE THIRD_PARTY.md ./
COPY src ./src
RUN pip install --no-cache-dir $PIP_OPTIONS '.[serve]' && rm -r /src/*

USER zeroscd
WORKDIR /state
ENV HOME=/state PYTHONUNBUFFERED=1
VOLUME /state
EXPOSE 8000

HEALTHCHECK --interval=30s --timeout=5s --start-period=90s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/healthz', timeout=4)"]

CMD ["zeroscd", "serve", "--host", "0.0.0.0", "--port", "8000", "--state", "/state"]
