defmodule Console.Options.Page do
  @moduledoc "Decides where a page is served: the options of the commands that have one. Reads the file of its token, nothing else."
  alias Console.Page
  alias Hal.Cli.Parse

  @token_file "a file of mode 0600 with 8 to 100 letters, digits, - and _"

  @doc "The rows for `Hal.Cli.Arguments`; names of files are relative to `folder`."
  @spec table(Path.t()) :: [Hal.Cli.Arguments.option()]
  def table(folder) do
    [
      {"page-address", "A", &address/1,
       "where the page is reached, such as 0.0.0.0, by other machines too (127.0.0.1)"},
      {"page-token-file", "FILE", &token(&1, folder),
       "the file of what others must know to use the page: ?token=…\n(of mode 0600; an option of its own would be seen in ps)"},
      {"page-origin", "URL", &origin/1,
       "how browsers know the page behind a proxy, such as https://robots.lab.example"}
    ]
  end

  @about %{
    foxglove: "serve Foxglove and Lichtblick at this port",
    rmf: "serve Open-RMF's fleet adapter at this port, as its fleet manager",
    rosbridge: "serve programs for ROS at this port, as rosbridge does"
  }

  @doc "The rows of the services that this build has besides (`Console.Page.Service`)."
  @spec services() :: [Hal.Cli.Arguments.option()]
  def services do
    for {name, {port, _module}} <- Page.Service.all(),
        do:
          {"#{name}", "[PORT]", &or_else(&1, port),
           "#{@about[name] || "serve #{name} at this port"} (#{port})"}
  end

  defp or_else("", port), do: {:ok, port}
  defp or_else(text, _port), do: port(text)

  @doc "A port from a text."
  @spec port(String.t()) :: {:ok, :inet.port_number()} | {:error, String.t()}
  def port(text) do
    with {:error, _allowed} <- Parse.whole(text, 0..65_535),
         do: {:error, "a port from 0 to 65535"}
  end

  @doc "A person who reaches the page may move robots: beyond this machine, and behind a proxy, it needs a token."
  @spec check(:inet.ip_address(), String.t() | nil, String.t() | nil) ::
          :ok | {:error, line :: String.t()}
  def check(address, token, origin) do
    cond do
      token != nil -> :ok
      not Page.Access.loopback?(address) -> needs_token("--page-address of other machines")
      origin != nil -> needs_token("--page-origin")
      true -> :ok
    end
  end

  defp needs_token(what),
    do:
      {:error, "#{what} needs --page-token-file: whoever knows the token may command the robots"}

  defp address(text) do
    with {:error, _reason} <- :inet.parse_ipv4strict_address(String.to_charlist(text)),
         do: {:error, "an IPv4 address of this machine"}
  end

  # As browsers write it: in small letters, without the port that goes without saying, and without a path.
  defp origin(text) do
    case URI.new(text) do
      {:ok, %URI{scheme: scheme, host: host, userinfo: nil, query: nil, fragment: nil} = uri}
      when scheme in ["http", "https"] and host not in [nil, ""] and uri.path in [nil, "/"] ->
        default? = uri.port == URI.default_port(scheme)
        port = if default?, do: "", else: ":#{uri.port}"
        {:ok, String.downcase("#{scheme}://#{host}") <> port}

      _no_origin ->
        {:error, "an address without a path, such as https://robots.lab.example"}
    end
  end

  # All users of a machine see what its programs were started with, so the token is no option itself.
  defp token(path, folder) do
    with {:ok, text} <- path |> Path.expand(folder) |> Mesh.Secret.File.read(),
         {:good, token, true} <- {:good, String.trim(text), good?(String.trim(text))} do
      {:ok, token}
    else
      {:error, problem} -> {:error, {@token_file, "; it #{problem}"}}
      {:good, _bad, false} -> {:error, {@token_file, "; it has something else"}}
    end
  end

  defp good?(text), do: text =~ ~r/\A[A-Za-z0-9_-]{8,100}\z/
end
