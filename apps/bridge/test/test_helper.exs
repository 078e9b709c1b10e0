Code.require_file("../../../test/start.exs", __DIR__)
