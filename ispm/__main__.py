"""`python -m ispm` is `ispm`."""

from ispm.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
